# GSPure step by step. Each job makes one thing, so a sweep repeats only the steps that it changes; results of further
# decisions are in folders of their own.


# One job per part of the views. Snakemake decides whether a model's contributions are stale; the keys in the names of the
# cached views decide which of them are computed again.
use rule base_step as measure_contributions with:
    input:
        get_made_model,
        cameras="results/{scheme}/{scene}/cameras.json",
    output:
        index="results/{scheme}/{scene}{decision}/contributions/{scatteritem}.json",
    log:
        "results/logs/{scheme}/{scene}{decision}/contributions-{scatteritem}.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}{decision}/contributions-{scatteritem}.tsv"
    params:
        **step(
            "contributions",
            **get_settings("energy"),
            model=get_public_model,
            cache=lambda wildcards: f"stages/{wildcards.scheme}/{wildcards.scene}/contributions",
            part=lambda wildcards: [*map(int, wildcards.scatteritem.split("-of-"))],
            scheme=get_scheme,
        ),
    message:
        "Measuring contributions in {wildcards.scheme}/{wildcards.scene}{wildcards.decision}, part {wildcards.scatteritem}"


use rule base_step as accumulate_weights with:
    input:
        get_made_model,
        indices=lambda wildcards: gather.views(
            "{folder}/{scatteritem}.json", folder=get_artifact("contributions")(wildcards)
        ),
        cameras="results/{scheme}/{scene}/cameras.json",
    output:
        weights="results/{scheme}/{scene}{decision}/weights.npy",
        opacities="results/{scheme}/{scene}{decision}/opacities.npy",
    log:
        "results/logs/{scheme}/{scene}{decision}/weights.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}{decision}/weights.tsv"
    threads: 1
    params:
        **step("weights", **get_settings("reduction", "views"), model=get_public_model, scheme=get_scheme),
    message:
        "Averaging contributions over the views of {wildcards.scheme}/{wildcards.scene}{wildcards.decision}"


use rule base_step as span_tree with:
    input:
        get_made_model,
        weights=get_artifact("weights.npy"),
        opacities=get_artifact("opacities.npy"),
    output:
        features="results/{scheme}/{scene}{decision}/features.npy",
        tree="results/{scheme}/{scene}{decision}/tree.npy",
    log:
        "results/logs/{scheme}/{scene}{decision}/tree.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}{decision}/tree.tsv"
    params:
        **step("tree", **get_settings("cluster_on", "min_samples"), model=get_public_model, scheme=get_scheme),
    message:
        "Computing the spanning tree of {wildcards.scheme}/{wildcards.scene}{wildcards.decision}"


use rule base_step as decide_pruning with:
    input:
        get_made_model,
        tree=get_artifact("tree.npy"),
        thresholded=lambda wildcards: get_decision(wildcards).thresholded,
    output:
        clusters="results/{scheme}/{scene}{decision}/clusters.npz",
        mask="results/{scheme}/{scene}{decision}/prune_mask.npy",
        diagnosis="results/{scheme}/{scene}{decision}/diagnosis.json",
    log:
        "results/logs/{scheme}/{scene}{decision}/prune_mask.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}{decision}/prune_mask.tsv"
    threads: 1
    params:
        **step("decision", model=get_public_model, **get_settings("selecting", "factors")),
    message:
        "Deciding what to prune in {wildcards.scheme}/{wildcards.scene}{wildcards.decision}"


# Distances of rows from the visible surface, which the attack `gof` needs.
use rule base_step as measure_surface with:
    input:
        get_made_model,
        cameras="results/{scheme}/{scene}/cameras.json",
    output:
        surface="results/{scheme}/{scene}/surface.npy",
    log:
        "results/logs/{scheme}/{scene}/surface.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/surface.tsv"
    params:
        **step("surface", model=get_public_model, scheme=get_scheme),
    message:
        "Measuring distances from the surface of {wildcards.scheme}/{wildcards.scene}"


# With the owner's key, it also writes hidden.npy and hidden.json: which rows hold the message.
use rule base_step as draw_model with:
    input:
        get_made_model,
        get_revealing_files,
        weights="results/{scheme}/{scene}/weights.npy",
        clusters="results/{scheme}/{scene}/clusters.npz",
        cameras="results/{scheme}/{scene}/cameras.json",
    output:
        figures=report(
            directory("results/{scheme}/{scene}/figures/model"),
            patterns=["{name,splats|weights|purification|separation|kept|clusters}.png"],
            caption="report/cloud.rst",
            category="{scheme}/{scene}",
            subcategory="Model",
            labels={"figure": "{name}"},
        ),
    log:
        "results/logs/{scheme}/{scene}/figures.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/figures.tsv"
    params:
        **step(
            "figures",
            model=get_public_model,
            settings=lambda wildcards: get_model(wildcards).method.settings,
            scheme=get_scheme,
            owner=get_revealing_owner,
        ),
    message:
        "Drawing the point cloud of {wildcards.scheme}/{wildcards.scene}"
