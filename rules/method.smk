# GSPure step by step. Each job makes one thing, so a sweep repeats only the steps that it changes; results of further
# decisions are in folders of their own.


# One job per part of the views. Snakemake decides whether a model's contributions are stale; the keys in the names of the
# cached views decide which of them are computed again.
rule measure_contributions:
    input:
        model=get_public_model,
        cameras="results/{scheme}/{scene}/cameras.json",
    output:
        index="results/{scheme}/{scene}{decision}/contributions/{scatteritem}.tsv",
    log:
        "results/logs/{scheme}/{scene}{decision}/contributions-{scatteritem}.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}{decision}/contributions-{scatteritem}.tsv"
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    resources:
        opencl_device=TURNS,
    params:
        kernels=KERNELS,
        code=lambda wildcards: code("contributions", get_model(wildcards).module),
        model=get_model_digest,
        job=job(
            cache=lambda wildcards: f"stages/{wildcards.scheme}/{wildcards.scene}/contributions",
            part=lambda wildcards: [*map(int, wildcards.scatteritem.split("-of-"))],
            energy=get_setting("energy"),
            scheme=get_scheme,
        ),
    message:
        "Measuring contributions in {wildcards.scheme}/{wildcards.scene}{wildcards.decision}, part {wildcards.scatteritem}"
    shell:
        step("contributions")


rule accumulate_weights:
    input:
        indices=lambda wildcards: gather.views(
            "{folder}/{scatteritem}.tsv", folder=get_made("contributions")(wildcards)
        ),
        model=get_public_model,
        cameras="results/{scheme}/{scene}/cameras.json",
    output:
        weights="results/{scheme}/{scene}{decision}/weights.npy",
        opacities="results/{scheme}/{scene}{decision}/opacities.npy",
    log:
        "results/logs/{scheme}/{scene}{decision}/weights.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}{decision}/weights.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=lambda wildcards: code("weights", get_model(wildcards).module),
        model=get_model_digest,
        job=job(reduction=get_setting("reduction"), views=get_setting("views"), scheme=get_scheme),
    message:
        "Averaging contributions over the views of {wildcards.scheme}/{wildcards.scene}{wildcards.decision}"
    shell:
        step("weights")


rule span_tree:
    input:
        model=get_public_model,
        weights=get_made("weights.npy"),
        opacities=get_made("opacities.npy"),
    output:
        features="results/{scheme}/{scene}{decision}/features.npy",
        tree="results/{scheme}/{scene}{decision}/tree.npy",
    log:
        "results/logs/{scheme}/{scene}{decision}/tree.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}{decision}/tree.tsv"
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    params:
        kernels=KERNELS,
        code=lambda wildcards: code("tree", get_model(wildcards).module),
        model=get_model_digest,
        job=job(cluster_on=get_setting("cluster_on"), min_samples=get_setting("min_samples"), scheme=get_scheme),
    message:
        "Computing the spanning tree of {wildcards.scheme}/{wildcards.scene}{wildcards.decision}"
    shell:
        step("tree")


rule decide_pruning:
    input:
        model=get_public_model,
        tree=get_made("tree.npy"),
        weights=lambda wildcards: get_model(wildcards).thresholded(get_decision(wildcards)),
    output:
        clusters="results/{scheme}/{scene}{decision}/clusters.npz",
        mask="results/{scheme}/{scene}{decision}/prune_mask.npy",
        diagnosis="results/{scheme}/{scene}{decision}/diagnosis.json",
    log:
        "results/logs/{scheme}/{scene}{decision}/prune_mask.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}{decision}/prune_mask.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        kernels=KERNELS,
        code=code("decision"),
        model=get_model_digest,
        job=job(
            **{name: get_setting(name) for name in ("min_cluster_size", "selection", "max_cluster_share")},
            **{name: get_setting(name) for name in ("tau_c", "tau_n")},
        ),
    message:
        "Deciding what to prune in {wildcards.scheme}/{wildcards.scene}{wildcards.decision}"
    shell:
        step("decision")


# Distances of rows from the visible surface, which the attack `gof` needs.
rule measure_surface:
    input:
        model=get_public_model,
        cameras="results/{scheme}/{scene}/cameras.json",
    output:
        surface="results/{scheme}/{scene}/surface.npy",
    log:
        "results/logs/{scheme}/{scene}/surface.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/surface.tsv"
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    resources:
        opencl_device=TURNS,
    params:
        kernels=KERNELS,
        code=lambda wildcards: code("surface", get_model(wildcards).module),
        model=get_model_digest,
        job=job(scheme=get_scheme),
    message:
        "Measuring distances from the surface of {wildcards.scheme}/{wildcards.scene}"
    shell:
        step("surface")


rule draw_model:
    input:
        model=get_public_model,
        weights="results/{scheme}/{scene}/weights.npy",
        clusters="results/{scheme}/{scene}/clusters.npz",
        cameras="results/{scheme}/{scene}/cameras.json",
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
        "results/logs/{scheme}/{scene}/figures.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/figures.tsv"
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    resources:
        opencl_device=TURNS,
    params:
        kernels=KERNELS,
        code=lambda wildcards: code("figures", get_model(wildcards).module),
        model=get_model_digest,
        job=job(settings=lambda wildcards: get_model(wildcards).decision(METHOD), scheme=get_scheme),
    message:
        "Drawing the point cloud of {wildcards.scheme}/{wildcards.scene}"
    shell:
        step("figures")


# With the owner's key, the figures also show which rows hold the message, and how much of it is on rows of low weight.
use rule draw_model as draw_watermarked_model with:
    input:
        model=get_public_model,
        weights="results/{scheme}/{scene}/weights.npy",
        clusters="results/{scheme}/{scene}/clusters.npz",
        cameras="results/{scheme}/{scene}/cameras.json",
        key="results/{scheme}/{scene}/key",
        message_cameras="results/{scheme}/{scene}/message_cameras.json",
    output:
        figures=report(
            directory("results/{scheme}/{scene}/figures/model"),
            patterns=["{name,splats|weights|purification|kept|clusters}.png"],
            caption="../report/cloud.rst",
            category="{scheme}/{scene}",
            subcategory="Model",
            labels={"figure": "{name}"},
        ),
        share="results/{scheme}/{scene}/hidden.json",
        hidden="results/{scheme}/{scene}/hidden.npy",
    wildcard_constraints:
        scheme=PICTURED,


ruleorder: draw_watermarked_model > draw_model
