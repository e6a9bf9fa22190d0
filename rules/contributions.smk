# One job per model, or per part of its views. Views that are already stored are not computed again: Snakemake decides
# whether a model's contributions are stale, the keys in the names of the stage files decide which views are.


rule measure_contributions:
    input:
        model=public_model,
        cameras="results/{scheme}/{scene}/cameras.json",
    output:
        index="results/{scheme}/{scene}/contributions/{scatteritem}.tsv",
    log:
        "results/logs/{scheme}/{scene}/contributions/{scatteritem}.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/contributions/{scatteritem}.tsv"
    conda:
        "../envs/gspure.yaml"
    threads: 16
    resources:
        opencl_device=1,
    params:
        kernels=KERNELS,
        code=code_digest("gspure.cli.contributions"),
        stages="stages/{scheme}/{scene}/contributions",
        part=lambda wildcards: wildcards.scatteritem.replace("-of-", "/"),
        options=options(config["method"], "energy"),
    message:
        "Measuring contributions in {wildcards.scheme}/{wildcards.scene}, part {wildcards.scatteritem}"
    shell:
        "POCL_MAX_PTHREAD_COUNT={threads} python -m gspure contributions --model {input.model:q}"
        " --cameras {input.cameras:q} --stages {params.stages:q} --part {params.part} {params.options}"
        " --index {output.index:q} > {log:q} 2>&1"


rule accumulate_weights:
    input:
        indices=gather.views("results/{{scheme}}/{{scene}}/contributions/{scatteritem}.tsv"),
        model=public_model,
    output:
        weights="results/{scheme}/{scene}/omega.npy",
    log:
        "results/logs/{scheme}/{scene}/omega.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/omega.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.weights"),
        options=options(config["method"], "reduction"),
    message:
        "Averaging contributions over the views of {wildcards.scheme}/{wildcards.scene}"
    shell:
        "python -m gspure weights --index {input.indices:q} --model {input.model:q} {params.options}"
        " --out {output.weights:q} > {log:q} 2>&1"
