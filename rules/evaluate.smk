# What a variant shows is compared with photographs of the planted truth, and where no truth is known, with what the
# watermarked model shows.


rule extract_message:
    input:
        model="results/{scheme}/{scene}/{variant}/public/point_cloud.ply",
        key="results/{scheme}/{scene}/key/planted_key.npz",
    output:
        model=temp("results/{scheme}/{scene}/{variant}/message.ply"),
    log:
        "results/logs/{scheme}/{scene}/{variant}/message.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/{variant}/message.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.message"),
    message:
        "Extracting the message from {wildcards.variant} of {wildcards.scheme}/{wildcards.scene}"
    shell:
        "python -m gspure message {input.model:q} --key {input.key:q} --out {output.model:q} > {log:q} 2>&1"


rule render_target:
    input:
        model=rendered_model,
        cameras="results/{scheme}/{scene}/cameras.json",
    output:
        images=directory("results/{scheme}/{scene}/{variant}/renders/{target}"),
    log:
        "results/logs/{scheme}/{scene}/{variant}/render_{target}.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/{variant}/render_{target}.tsv"
    wildcard_constraints:
        target="scene|message",
    conda:
        "../envs/gspure.yaml"
    threads: 16
    resources:
        opencl_device=1,
    params:
        kernels=KERNELS,
        code=code_digest("gspure.cli.render"),
        split=config["views"]["evaluate"],
    message:
        "Rendering the {wildcards.target} of {wildcards.variant} of {wildcards.scheme}/{wildcards.scene}"
    shell:
        "POCL_MAX_PTHREAD_COUNT={threads} python -m gspure render {input.model:q} --cameras {input.cameras:q}"
        " --split {params.split} --out {output.images:q} > {log:q} 2>&1"


rule compare_renders:
    input:
        images=renders,
        references=references,
    output:
        metrics="results/{scheme}/{scene}/{variant}/metrics.csv",
    log:
        "results/logs/{scheme}/{scene}/{variant}/metrics.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/{variant}/metrics.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.metrics"),
        images=lambda wildcards, input: os.path.dirname(input.images[0]),
        references=lambda wildcards, input: os.path.dirname(input.references[0]),
        reference=lambda wildcards: "truth" if wildcards.scheme == "planted" else "render",
    message:
        "Comparing the renders of {wildcards.variant} of {wildcards.scheme}/{wildcards.scene}"
    shell:
        "python -m gspure metrics {params.references:q} {params.images:q} --reference {params.reference}"
        " --out {output.metrics:q} > {log:q} 2>&1"


rule tabulate_metrics:
    input:
        metrics=expand("results/{model}/{variant}/metrics.csv", model=MODELS, variant=VARIANTS),
        kept=expand("results/{model}/{variant}/kept.npy", model=MODELS, variant=VARIANTS),
        truth=expand("results/planted/{scene}/key/carriers.npy", scene=SCHEMES["planted"]),
    output:
        table="results/tables/results.csv",
        markdown=report("results/tables/results.md"),
    log:
        "results/logs/table.log",
    benchmark:
        "results/benchmarks/table.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.table"),
    message:
        "Tabulating all variants"
    shell:
        "python -m gspure table --metrics {input.metrics:q} --kept {input.kept:q} --truth {input.truth:q}"
        " --out {output.table:q} --markdown {output.markdown:q} > {log:q} 2>&1"
