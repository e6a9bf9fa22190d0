# Variants of a model: attacked, rendered, and compared with photographs of scene and message or, without photographs, with
# renders of the unattacked model.


# An attack that cannot apply is an outcome, which the verdict tells; it leaves no model.
rule attack_model:
    input:
        unpack(lambda wildcards: {**get_variant(wildcards).measured, **get_variant(wildcards).rendered}),
        model=get_public_model,
    output:
        public=directory("results/{scheme}/{scene}/{variant}/public"),
        verdict="results/{scheme}/{scene}/{variant}/verdict.json",
    log:
        "results/logs/{scheme}/{scene}/{variant}/attack.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/{variant}/attack.tsv"
    conda:
        "../envs/gspure.yaml"
    threads: lambda wildcards: THREADS if get_variant(wildcards).rendered else 1
    resources:
        opencl_device=lambda wildcards: TURNS if get_variant(wildcards).rendered else 0,
    params:
        version=version("attack"),
        attack=lambda wildcards: code_digest(get_variant(wildcards).attack.function.__module__),
        settings=settings(lambda wildcards: get_variant(wildcards).attacked_by, scheme=get_scheme),
        files=files,
    message:
        "Attacking {wildcards.scheme}/{wildcards.scene}: {wildcards.variant}"
    shell:
        step("attack")


rule evaluate_variant:
    input:
        lambda wildcards: get_evaluated_files(get_model(wildcards), [wildcards.variant]),
        "results/{scheme}/{scene}/{variant}/public",
        "results/{scheme}/{scene}/{variant}/verdict.json",
    output:
        "results/{scheme}/{scene}/{variant}/metrics.csv",
        "results/{scheme}/{scene}/{variant}/retrieval.csv",
        directory("results/{scheme}/{scene}/{variant}/renders"),
        directory("results/{scheme}/{scene}/{variant}/detections"),
    log:
        "results/logs/{scheme}/{scene}/{variant}/evaluate.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/{variant}/evaluate.tsv"
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    resources:
        opencl_device=TURNS,
    params:
        version=version("evaluate"),
        read=lambda wildcards: files_digest(get_variant(wildcards).users_files),
        settings=settings(lambda wildcards: get_model(wildcards).evaluation([wildcards.variant])),
        files=files,
    message:
        "Evaluating {wildcards.variant} of {wildcards.scheme}/{wildcards.scene}"
    shell:
        step("evaluate")


# All negative controls of a model; the output lists them, and each has a folder of its own, as variants have.
rule evaluate_controls:
    input:
        lambda wildcards: get_evaluated_files(get_model(wildcards), get_model(wildcards).controls),
    output:
        listed="results/{scheme}/{scene}/controls.json",
    log:
        "results/logs/{scheme}/{scene}/controls.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/controls.tsv"
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    resources:
        opencl_device=TURNS,
    params:
        version=version("evaluate"),
        read=lambda wildcards: files_digest(
            file for name in get_model(wildcards).controls for file in Variant(get_model(wildcards), name).users_files
        ),
        settings=settings(lambda wildcards: get_model(wildcards).evaluation(get_model(wildcards).controls)),
        files=files,
    message:
        "Evaluating the negative controls of {wildcards.scheme}/{wildcards.scene}"
    shell:
        step("evaluate")


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
        code=code("decoys"),
        settings=settings(
            folder=lambda wildcards: "results/decoys/{width}x{height}x{views}".format(**wildcards),
            **{name: lambda wildcards, name=name: int(wildcards[name]) for name in ("views", "width", "height")},
        ),
        files=files,
    message:
        "Ray-tracing random scenes as candidates of the retrieval"
    shell:
        step("decoys")


REPORTED = [f"{variant.folder}/metrics.csv" for model in PLAN.models for variant in model.variants]
REPORTED += [f"{model.folder}/controls.json" for model in PLAN.models if model.controls]
REPORTED += expand("results/{model}/{made}", model=MODELS, made=["diagnosis.json", "figures/model"])


# It scans the results, so it also runs, `onerror`, when some are missing.
rule write_report:
    input:
        REPORTED,
    output:
        page=report("results/report.html", caption="../report/page.rst", category="Report", labels={"page": "report"}),
        table="results/tables/results.csv",
        results=report("results/tables/results.md", category="Tables", labels={"table": "all results"}),
        contest=report("results/tables/contest.md", category="Tables", labels={"table": "GSPure against other attacks"}),
    log:
        "results/logs/report.log",
    benchmark:
        "results/benchmarks/report.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code("report"),
        templates=files_digest(sorted(Path(gspure.__file__).parent.glob("report/templates/*"))),
        plan=str(PLAN.report),
    message:
        "Writing tables, figures and the report"
    shell:
        logged("python -m gspure report results")
