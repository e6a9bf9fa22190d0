# The views of a model: the public ones and, with the prefix `message_`, those of the message, which only the owner has.


rule generate_off_path:
    input:
        cameras="results/{scheme}/{scene}/{owner}cameras.json",
    output:
        cameras="results/{scheme}/{scene}/{owner}off_path.json",
    log:
        "results/logs/{scheme}/{scene}/{owner}off_path.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/{owner}off_path.tsv"
    wildcard_constraints:
        owner=f"(?:{OWNER})?",
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.cameras"),
        views=config["views"]["off_path"],
    message:
        "Generating views off the camera path of {wildcards.scheme}/{wildcards.scene}"
    shell:
        job("cameras {input.cameras:q} --resolution native --off-path {params.views} --out {output.cameras:q}")


rule prepare_cameras:
    input:
        cameras=get_camera_files,
        model=get_public_model,
    output:
        cameras="results/{scheme}/{scene}/{owner}cameras.json",
    log:
        "results/logs/{scheme}/{scene}/{owner}cameras.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/{owner}cameras.tsv"
    wildcard_constraints:
        owner=f"(?:{OWNER})?",
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.cameras"),
        source=lambda wildcards: get_model(wildcards).camera_source(get_target(wildcards)),
        options=lambda wildcards: get_model(wildcards).camera_options,
    message:
        "Preparing the cameras of {wildcards.scheme}/{wildcards.scene}"
    shell:
        job("cameras {params.source:q} {params.options} --out {output.cameras:q}")
