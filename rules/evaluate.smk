# Renders of a variant are compared with photographs of scene and message or, without photographs, with renders of the
# unattacked model.


rule render_scene:
    input:
        unpack(get_variant_files),
    output:
        images=directory("results/{scheme}/{scene}/{variant}/renders/scene"),
    log:
        "results/logs/{scheme}/{scene}/{variant}/render_scene.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/{variant}/render_scene.tsv"
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    resources:
        opencl_device=TURNS,
    params:
        kernels=KERNELS,
        code=code_digest("gspure.cli.render"),
        split=config["views"]["evaluate"],
        views=get_view_options,
        scheme=get_scheme,
    message:
        "Rendering the scene of {wildcards.variant} of {wildcards.scheme}/{wildcards.scene}"
    shell:
        job("render {input.model:q} {params.scheme}" " --split {params.split} {params.views} --out {output.images:q}")


rule extract_message:
    input:
        unpack(get_variant_files),
        key="results/{scheme}/{scene}/key",
    output:
        images=directory("results/{scheme}/{scene}/{variant}/renders/{target}"),
    log:
        "results/logs/{scheme}/{scene}/{variant}/extract_{target}.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/{variant}/extract_{target}.tsv"
    wildcard_constraints:
        scheme="|".join(PLAN.schemes) or "none",
        target="message[a-z_]*",
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    resources:
        opencl_device=TURNS,
    params:
        kernels=KERNELS,
        code=lambda wildcards: get_model(wildcards).code("extract"),
        split=config["views"]["evaluate"],
        options=lambda wildcards: get_variant(wildcards).extraction_options(wildcards.target),
        views=get_view_options,
    message:
        "Extracting the {wildcards.target} from {wildcards.variant} of {wildcards.scheme}/{wildcards.scene}"
    shell:
        job(
            "extract {input.model:q} --key {input.key:q} {params.options}"
            " --split {params.split} {params.views} --out {output.images:q}"
        )


rule compare_renders:
    input:
        images=lambda wildcards: get_variant(wildcards).renders,
        references=lambda wildcards: get_model(wildcards).references,
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
        options=lambda wildcards: get_variant(wildcards).comparison_options,
    message:
        "Comparing the renders of {wildcards.variant} of {wildcards.scheme}/{wildcards.scene}"
    shell:
        job("metrics {params.references:q} {params.images:q} {params.options}" " --out {output.metrics:q}")


rule detect_mark:
    input:
        images="results/{scheme}/{scene}/{variant}/renders/scene",
        files=get_detector_files,
    output:
        table="results/{scheme}/{scene}/{variant}/detections/{detector}.csv",
    log:
        "results/logs/{scheme}/{scene}/{variant}/detect_{detector}.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/{variant}/detect_{detector}.tsv"
    wildcard_constraints:
        detector="|".join([*config["detectors"], BITS]),
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.detect"),
        options=lambda wildcards: get_variant(wildcards).detection_options(wildcards.detector),
    message:
        "Reading {wildcards.detector} from {wildcards.variant} of {wildcards.scheme}/{wildcards.scene}"
    shell:
        job("detect {input.images:q} {params.options} --out {output.table:q}")


rule trace_decoys:
    output:
        directory(expand("results/decoys/{{width}}x{{height}}x{{views}}/{seed}", seed=DECOYS)),
    log:
        "results/logs/decoys/{width}x{height}x{views}.log",
    benchmark:
        "results/benchmarks/decoys/{width}x{height}x{views}.tsv"
    wildcard_constraints:
        width="[0-9]+",
        height="[0-9]+",
        views="[0-9]+",
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.decoys"),
        folder="results/decoys/{width}x{height}x{views}",
    message:
        "Ray-tracing random scenes as candidates of the retrieval"
    shell:
        job(
            "decoys --views {wildcards.views} --width {wildcards.width} --height {wildcards.height}"
            " --out {params.folder:q}"
        )


rule retrieve_message:
    input:
        pair=lambda wildcards: get_model(wildcards).references,
        extractions=lambda wildcards: get_extractions(get_model(wildcards)),
        decoys=lambda wildcards: get_finished(get_model(wildcards).decoys),
    output:
        table="results/{scheme}/{scene}/retrieval.csv",
    log:
        "results/logs/{scheme}/{scene}/retrieval.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/retrieval.tsv"
    wildcard_constraints:
        scheme="|".join(PLAN.schemes) or "none",
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.retrieve"),
    message:
        "Retrieving the message of {wildcards.scheme}/{wildcards.scene} among candidates"
    shell:
        job(
            "retrieve {input.pair[1]:q} --extractions {input.extractions:q} --decoys {input.decoys:q}"
            " --out {output.table:q}"
        )


rule tabulate_metrics:
    input:
        metrics=get_finished(path for model in PLAN.models for path in model.metrics),
        masks=get_finished(expand("results/{model}/{variant}/prune_mask.npy", model=MODELS, variant=VARIANTS)),
        verdicts=get_finished(expand("results/{model}/{variant}/verdict.json", model=MODELS, variant=VARIANTS)),
        retrievals=get_finished(
            f"{model.folder}/retrieval.csv" for model in PLAN.models if model.is_watermarked and get_extractions(model)
        ),
        detections=get_finished(path for model in PLAN.models for path in model.detections),
        key_folders=get_finished(f"{model.folder}/key" for model in PLAN.models if model.is_watermarked),
        failures=[status_of(failure.log) for failure in FAILURES],
    output:
        table="results/tables/results.csv",
        markdown=report("results/tables/results.md", category="Tables", labels={"table": "all results"}),
        summary="results/tables/summary.csv",
        latex="results/tables/summary.tex",
    log:
        "results/logs/table.log",
    benchmark:
        "results/benchmarks/table.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.table"),
        templates=TEMPLATE_DIGESTS,
        conditions=PLAN.condition_options,
    message:
        "Tabulating all variants"
    shell:
        job(
            "table --metrics {input.metrics:q} --prune-masks {input.masks:q} --keys {input.key_folders:q}"
            " --verdicts {input.verdicts:q} --failures {input.failures:q} --retrievals {input.retrievals:q}"
            " --detections {input.detections:q}"
            " {params.conditions} --out {output.table:q} --markdown {output.markdown:q} --summary {output.summary:q} --latex {output.latex:q}"
        )
