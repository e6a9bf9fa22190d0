rule plant_scene:
    output:
        model="results/planted/{scene}/public/point_cloud.ply",
        cameras="results/planted/{scene}/cameras.json",
        points="results/planted/{scene}/points3D.ply",
        key="results/planted/{scene}/key/planted_key.npz",
        carriers="results/planted/{scene}/key/carriers.npy",
        scene=directory("results/planted/{scene}/truth/scene"),
        message=directory("results/planted/{scene}/truth/message"),
    log:
        "results/logs/planted/{scene}/plant.log",
    benchmark:
        "results/benchmarks/planted/{scene}/plant.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.plant"),
        folder="results/planted/{scene}",
        options=lambda wildcards: options(
            {**config["planted"][wildcards.scene], "off_path": config["views"]["off_path"]},
            *sorted(config["planted"][wildcards.scene]),
            "off_path",
        ),
    message:
        "Planting a message in {wildcards.scene}"
    shell:
        job("plant {params.options} --out {params.folder:q}")


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
        cameras=get_camera_files,
        model=public_model,
    output:
        cameras="results/{scheme}/{scene}/cameras.json",
    log:
        "results/logs/{scheme}/{scene}/cameras.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/cameras.tsv"
    wildcard_constraints:
        scheme="|".join(["vanilla", *WATERMARKS]),
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.cameras"),
        source=camera_source,
        options=camera_options,
    message:
        "Preparing the views of {wildcards.scene}"
    shell:
        job("cameras {params.source:q} {params.options} --out {output.cameras:q}")
