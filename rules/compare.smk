# Variants of a condition, that is of a scheme, protocol and initialization, compared over all of its scenes.


rule match_damage:
    input:
        table="results/tables/results.csv",
    output:
        table="results/tables/matched.csv",
        markdown=report("results/tables/matched.md"),
    log:
        "results/logs/matched.log",
    benchmark:
        "results/benchmarks/matched.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.matched"),
        templates=TEMPLATE_DIGESTS,
        sweeps=PLAN.sweep_options,
    message:
        "Comparing attacks at equal damage to the scene"
    shell:
        job("matched --table {input.table:q} {params.sweeps}" " --out {output.table:q} --markdown {output.markdown:q}")


rule hold_contest:
    input:
        table="results/tables/results.csv",
    output:
        table="results/tables/contest.csv",
        survival="results/tables/survival.csv",
        markdown=report("results/tables/contest.md"),
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
    message:
        "Comparing GSPure with every other attack"
    shell:
        job(
            "contest --table {input.table:q} {params.sweeps} --out {output.table:q}"
            " --survival {output.survival:q} --markdown {output.markdown:q}"
        )


rule draw_sweep:
    input:
        table="results/tables/results.csv",
    output:
        figure=report(
            "results/figures/{condition}/sweep.png",
            caption="../report/sweep.rst",
            category="{condition}",
            subcategory="All scenes",
        ),
    log:
        "results/logs/figures/{condition}/sweep.log",
    benchmark:
        "results/benchmarks/figures/{condition}/sweep.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.scheme_figures"),
        points=lambda wildcards: PLAN.point_options(wildcards.condition.rsplit("-", 2)[0]),
    message:
        "Drawing {wildcards.condition} against the pruning factors"
    shell:
        job(
            "figures sweep --table {input.table:q} --condition {wildcards.condition} {params.points}"
            " --out {output.figure:q}"
        )


rule draw_tradeoff:
    input:
        table="results/tables/results.csv",
    output:
        figure=report(
            "results/figures/{condition}/tradeoff.png",
            caption="../report/tradeoff.rst",
            category="{condition}",
            subcategory="All scenes",
        ),
    log:
        "results/logs/figures/{condition}/tradeoff.log",
    benchmark:
        "results/benchmarks/figures/{condition}/tradeoff.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.scheme_figures"),
    message:
        "Drawing what variants of {wildcards.condition} leave of the message"
    shell:
        job("figures tradeoff --table {input.table:q} --condition {wildcards.condition} --out {output.figure:q}")
