def camera_files(wildcards):
    """What the views of an asset are made from: a file, the camera files of a folder, or nothing if generated."""
    source = config["assets"][wildcards.scene]["cameras"]
    if source in GENERATED:
        return []
    if Path(source).is_dir():
        return [path for name in CAMERA_FILES if (path := os.path.join(source, name)) and os.path.exists(path)]
    return source


def camera_options(wildcards, input):
    """How the views of an asset are scaled or generated."""
    asset = config["assets"][wildcards.scene]
    if asset["cameras"] in GENERATED:
        return f"--model {shlex.quote(input.model)} {options(asset['generated'], *asset['generated'])}"
    return options(asset, "scale")


rule prepare_cameras:
    input:
        cameras=camera_files,
        model=public_model,
    output:
        cameras="results/{scheme}/{scene}/cameras.json",
    log:
        "results/logs/{scheme}/{scene}/cameras.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/cameras.tsv"
    wildcard_constraints:
        scheme="vanilla",
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.cameras"),
        source=lambda wildcards: config["assets"][wildcards.scene]["cameras"],
        options=camera_options,
    message:
        "Preparing the views of {wildcards.scene}"
    shell:
        "python -m gspure cameras {params.source:q} {params.options} --out {output.cameras:q} > {log:q} 2>&1"
