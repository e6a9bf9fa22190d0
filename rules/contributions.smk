# One job per model, or per part of its views. Snakemake decides whether a model's contributions are stale; the keys in the
# names of the stage files decide which views are computed again.


rule measure_contributions:
    input:
        model=get_public_model,
        cameras="results/{scheme}/{scene}/cameras.json",
    output:
        index="results/{scheme}/{scene}{decision}/contributions/{scatteritem}.tsv",
    log:
        "results/logs/{scheme}/{scene}{decision}/contributions/{scatteritem}.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}{decision}/contributions/{scatteritem}.tsv"
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    resources:
        opencl_device=TURNS,
    params:
        kernels=KERNELS,
        code=code_digest("gspure.cli.contributions"),
        stages="stages/{scheme}/{scene}/contributions",
        part=lambda wildcards: wildcards.scatteritem.replace("-of-", "/"),
        options=get_method_options("energy"),
        scheme=get_scheme,
    message:
        "Measuring contributions in {wildcards.scheme}/{wildcards.scene}{wildcards.decision}, part {wildcards.scatteritem}"
    shell:
        job(
            "contributions --model {input.model:q} {params.scheme}"
            " --cameras {input.cameras:q} --stages {params.stages:q} --part {params.part} {params.options}"
            " --index {output.index:q}"
        )


rule accumulate_weights:
    input:
        indices=get_contributions,
        model=get_public_model,
    output:
        weights="results/{scheme}/{scene}{decision}/weights.npy",
    log:
        "results/logs/{scheme}/{scene}{decision}/weights.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}{decision}/weights.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.weights"),
        options=get_method_options("reduction", "views"),
    message:
        "Averaging contributions over the views of {wildcards.scheme}/{wildcards.scene}{wildcards.decision}"
    shell:
        job("weights --index {input.indices:q} --model {input.model:q} {params.options}" " --out {output.weights:q}")
