# A killed run continues from its last checkpoint, which is beside the outputs.


rule train_model:
    input:
        data=get_training_files,
    output:
        model="results/vanilla/{scene}/public/point_cloud.ply",
        cameras="results/vanilla/{scene}/trained/cameras.json",
    log:
        "results/logs/vanilla/{scene}/train.log",
    benchmark:
        "results/benchmarks/vanilla/{scene}/train.tsv"
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    resources:
        opencl_device=TURNS,
    params:
        kernels=KERNELS,
        code=code_digest("gspure.cli.train"),
        data=lambda wildcards: config["assets"][wildcards.scene]["train"],
        folder="results/vanilla/{scene}/trained",
        options=get_training_options,
    message:
        "Training a model of {wildcards.scene}"
    shell:
        job("train {params.data:q} {params.options} --resume" " --out {params.folder:q} --model {output.model:q}")
