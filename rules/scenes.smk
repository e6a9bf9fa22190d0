rule step_off_path:
    input:
        cameras="results/{scheme}/{scene}/cameras.json",
    output:
        cameras="results/{scheme}/{scene}/off_path.json",
    log:
        "results/logs/{scheme}/{scene}/off_path.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/off_path.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.cameras"),
        views=config["views"]["off_path"],
    message:
        "Stepping off the path of {wildcards.scheme}/{wildcards.scene}"
    shell:
        job("cameras {input.cameras:q} --scale native --off-path {params.views} --out {output.cameras:q}")


rule prepare_cameras:
    input:
        cameras=lambda wildcards: get_model(wildcards).camera_files,
        model=get_public_model,
    output:
        cameras="results/{scheme}/{scene}/cameras.json",
    log:
        "results/logs/{scheme}/{scene}/cameras.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/cameras.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.cameras"),
        source=lambda wildcards: get_model(wildcards).camera_source,
        options=lambda wildcards: get_model(wildcards).camera_options,
    message:
        "Preparing the views of {wildcards.scene}"
    shell:
        job("cameras {params.source:q} {params.options} --out {output.cameras:q}")
