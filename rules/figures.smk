rule draw_model:
    input:
        model=get_public_model,
        weights="results/{scheme}/{scene}/weights.npy",
        clusters="results/{scheme}/{scene}/clusters.npz",
        cameras="results/{scheme}/{scene}/cameras.json",
        hidden=lambda wildcards: get_model(wildcards).hidden,
    output:
        figures=report(
            directory("results/{scheme}/{scene}/figures/model"),
            patterns=["{name,splats|weights|purification|kept|clusters}.png"],
            caption="../report/cloud.rst",
            category="{scheme}/{scene}",
            subcategory="Model",
            labels={"figure": "{name}"},
        ),
    log:
        "results/logs/{scheme}/{scene}/figures/model.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/figures/model.tsv"
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    resources:
        opencl_device=TURNS,
    params:
        kernels=KERNELS,
        code=code_digest("gspure.cli.figures"),
        scheme=get_scheme,
        factors=get_method_options("tau_c", "tau_n"),
        message=lambda wildcards, input: options(input, "hidden") if input.hidden else "",
    message:
        "Drawing the point cloud of {wildcards.scheme}/{wildcards.scene}"
    shell:
        job(
            "figures model --model {input.model:q} --weights {input.weights:q} --clusters {input.clusters:q}"
            " --cameras {input.cameras:q} {params.scheme} {params.message} {params.factors} --out {output.figures:q}"
        )


rule draw_panels:
    input:
        columns=lambda wildcards: get_model(wildcards).panel_columns(wildcards.target).values(),
    output:
        figure=report(
            "results/{scheme}/{scene}/figures/{target}.png",
            caption="../report/figure.rst",
            category="{scheme}/{scene}",
            subcategory="Images",
            labels={"figure": "{target}"},
        ),
    log:
        "results/logs/{scheme}/{scene}/figures/{target}.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/figures/{target}.tsv"
    wildcard_constraints:
        target="scene|message[a-z_]*",
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.figures"),
        columns=lambda wildcards: repeated("--column", get_model(wildcards).panel_columns(wildcards.target)),
    message:
        "Drawing the {wildcards.target} of {wildcards.scheme}/{wildcards.scene} before and after"
    shell:
        job("figures panels {params.columns} --difference --out {output.figure:q}")


rule draw_variants:
    input:
        table="results/tables/results.csv",  # names all images, and those that are missing
    output:
        figure=report(
            "results/{scheme}/{scene}/figures/{figure}.png",
            caption="../report/figure.rst",
            category="{scheme}/{scene}",
            subcategory="Variants",
            labels={"figure": "{figure}"},
        ),
    log:
        "results/logs/{scheme}/{scene}/figures/{figure}.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/figures/{figure}.tsv"
    wildcard_constraints:
        figure="|".join({name for model in PLAN.models for name in model.variant_figures}),
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.figures"),
        name="{scheme}/{scene}",
        options=lambda wildcards: get_model(wildcards).variant_figures[wildcards.figure],
    message:
        "Drawing the {wildcards.figure} of {wildcards.scheme}/{wildcards.scene}"
    shell:
        job(
            "figures {wildcards.figure} --table {input.table:q} --name {params.name:q} {params.options}"
            " --out {output.figure:q}"
        )
