# Variants of a model: attacked, rendered, and compared with photographs or renders of the unattacked model.


# An attack that cannot apply is an outcome, which its record tells; it leaves no model.
use rule base_step as evaluate_variant with:
    input:
        get_inputs(get_job),
    output:
        directory(expand("results/{{scheme}}/{{scene}}/{{variant}}/{part}", part=["public", "renders", "detections"])),
        expand(
            "results/{{scheme}}/{{scene}}/{{variant}}/{file}",
            file=["attack.json", "prune_mask.npy", "metrics.csv", "evidence.json"],
        ),
    log:
        "results/logs/{scheme}/{scene}/{variant}/evaluate.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/{variant}/evaluate.tsv"
    priority: 0  # short jobs last, so that no core is idle at the end
    params:
        **job_parameters(get_job),
    message:
        "Evaluating {wildcards.variant} of {wildcards.scheme}/{wildcards.scene}"


# All negative controls of a model; the output lists them, and each has a folder of its own, as variants have.
use rule base_step as evaluate_controls with:
    input:
        get_inputs(get_controls),
    output:
        listed="results/{scheme}/{scene}/controls.json",
    log:
        "results/logs/{scheme}/{scene}/controls.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/controls.tsv"
    params:
        **job_parameters(get_controls),
    message:
        "Evaluating the negative controls of {wildcards.scheme}/{wildcards.scene}"


use rule base_step as trace_candidates with:
    output:
        candidates="results/candidates/{candidates}.npy",
    log:
        "results/logs/candidates/{candidates}.log",
    benchmark:
        "results/benchmarks/candidates/{candidates}.tsv"
    wildcard_constraints:
        candidates="|".join(PLAN.candidates) or "none",
    threads: 1
    params:
        **step(
            "candidates",
            version=code_of("candidates"),
            settings=lambda wildcards: PLAN.candidates[wildcards.candidates],
        ),
    message:
        "Ray-tracing candidates: scenes of the message's kind"


REPORTED = [f"{model.folder}/{variant}/metrics.csv" for model in PLAN.models for variant in VARIANTS]
REPORTED += [f"{model.folder}/controls.json" for model in PLAN.models if model.controls]
REPORTED += expand("results/{model}/{made}", model=MODELS, made=["diagnosis.json", "figures/model"])


# It scans the results, so it also runs, `onerror`, when some are missing.
rule write_report:
    input:
        REPORTED,
    output:
        page=report("results/report.html", caption="report/page.rst", category="Report", labels={"page": "report"}),
        table="results/tables/results.csv",
        results=report("results/tables/results.md", category="Tables", labels={"table": "all results"}),
        radius="results/radius.json",
    log:
        "results/logs/report.log",
    benchmark:
        "results/benchmarks/report.tsv"
    conda:
        "envs/gspure.yaml"
    params:
        code=code_of("report"),
        templates=files_digest(sorted(Path(gspure.__file__).parent.glob("*/templates/*"))),
        plan=lambda wildcards: codec.text(PLAN),  # a plain text with braces would be taken for wildcards
    message:
        "Writing tables, figures and the report"
    shell:
        logged("python -m gspure report results")
