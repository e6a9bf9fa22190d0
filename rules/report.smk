SHOWN = [model for model in PLAN.models if get_finished(model.metrics)]
FIGURES = [path for model in SHOWN for path in model.figures]
CONDITION_FIGURES = [
    f"results/figures/{condition.key}/{name}.png"
    for condition in dict.fromkeys(model.condition for model in SHOWN)
    for name in PLAN.condition_figures(condition.scheme)
]


rule write_report:
    input:
        table="results/tables/results.csv",
        clouds=get_finished(expand("results/{model}/figures/model", model=MODELS)),
        figures=get_finished(path for path in FIGURES if os.path.basename(os.path.dirname(path)) != "model"),
        comparisons=get_finished(CONDITION_FIGURES),
        matched="results/tables/matched.csv",
        contest="results/tables/contest.csv",
        survival="results/tables/survival.csv",
        costs=f"{COSTS}/attacks.csv",
        summary="results/tables/summary.csv",
        diagnoses=get_finished(expand("results/{model}/diagnosis.json", model=MODELS)),
        hidden=get_finished(f"{model.folder}/hidden.json" for model in PLAN.models if model.hidden),
        artifacts=get_finished(
            expand(
                "results/{model}/{artifact}",
                model=MODELS,
                artifact=["weights.npy", "features.npy", "tree.npy", "clusters.npz", "prune_mask.npy"],
            )
        ),
    output:
        page=report("results/report.html", caption="../report/page.rst", category="Report", labels={"page": "report"}),
    log:
        "results/logs/report.log",
    benchmark:
        "results/benchmarks/report.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.report"),
        templates=TEMPLATE_DIGESTS,
        figures=get_finished([*FIGURES, *CONDITION_FIGURES]),
        viewers=get_finished(expand("results/{model}/figures/model/viewer.json", model=MODELS)),
        links=[*map(os.path.relpath, workflow.configfiles), "results/logs"],
        records=lambda wildcards, input: [
            f"{path}.json"
            for path in [input.table, input.summary, input.matched, input.contest, input.survival, *input.artifacts]
        ],
    message:
        "Writing the report"
    shell:
        job(
            "report --table {input.table:q} --figures {params.figures:q} --diagnosis {input.diagnoses:q} {input.hidden:q}"
            " --viewer {params.viewers:q} --matched {input.matched:q} --contest {input.contest:q} --survival {input.survival:q}"
            " --costs {input.costs:q}"
            " --records {params.records:q} --link {params.links:q} --out {output.page:q}"
        )
