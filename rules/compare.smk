# Variants of a condition, that is of a scheme, protocol and initialization, compared over all of its scenes.


rule compare_attacks:
    input:
        table="results/tables/results.csv",
    output:
        table="results/tables/contest.csv",
        survival="results/tables/survival.csv",
        matched="results/tables/matched.csv",
        markdown=report(
            "results/tables/contest.md", category="Tables", labels={"table": "GSPure against other attacks"}
        ),
        costs=f"{COSTS}/attacks.csv",
    log:
        "results/logs/contest.log",
    benchmark:
        "results/benchmarks/contest.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.contest"),
        templates=TEMPLATE_DIGESTS,
        sweeps=PLAN.sweep_options,
        benchmarks=subpath(output.costs, parent=True),
    message:
        "Comparing GSPure with every other attack"
    shell:
        job(
            "contest --table {input.table:q} {params.sweeps} --out {output.table:q} --survival {output.survival:q}"
            " --matched {output.matched:q} --markdown {output.markdown:q}"
            " --benchmarks {params.benchmarks} --costs {output.costs:q}"
        )


rule draw_condition:
    input:
        table="results/tables/results.csv",
    output:
        figure=report(
            "results/figures/{condition}/{figure}.png",
            caption="../report/figure.rst",
            category="{condition}",
            subcategory="All scenes",
            labels={"figure": "{figure}"},
        ),
    log:
        "results/logs/figures/{condition}/{figure}.log",
    benchmark:
        "results/benchmarks/figures/{condition}/{figure}.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.scheme_figures"),
        options=lambda wildcards: PLAN.condition_figures(wildcards.condition.rsplit("-", 2)[0])[wildcards.figure],
    message:
        "Drawing the {wildcards.figure} of {wildcards.condition}"
    shell:
        job(
            "figures {wildcards.figure} --table {input.table:q} --condition {wildcards.condition} {params.options}"
            " --out {output.figure:q}"
        )
