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
