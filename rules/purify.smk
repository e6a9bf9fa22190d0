# The spanning tree depends on min_samples alone, the clusters on how they are selected, the mask on the factors tau:
# each is a result of its own, so that a sweep repeats only what it changes.


rule measure_opacities:
    input:
        model=public_model,
        cameras="results/{scheme}/{scene}/cameras.json",
    output:
        opacities="results/{scheme}/{scene}/opacities.npy",
    log:
        "results/logs/{scheme}/{scene}/opacities.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/opacities.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.opacities"),
    message:
        "Taking the opacities of {wildcards.scheme}/{wildcards.scene}"
    shell:
        "python -m gspure opacities --model {input.model:q} --cameras {input.cameras:q} --out {output.opacities:q}"
        " > {log:q} 2>&1"


rule build_features:
    input:
        model=public_model,
        weights="results/{scheme}/{scene}/omega.npy",
        opacities="results/{scheme}/{scene}/opacities.npy",
    output:
        features="results/{scheme}/{scene}/features.npy",
    log:
        "results/logs/{scheme}/{scene}/features.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/features.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.features"),
    message:
        "Standardizing positions, opacities and weights of {wildcards.scheme}/{wildcards.scene}"
    shell:
        "python -m gspure features --model {input.model:q} --weights {input.weights:q}"
        " --opacities {input.opacities:q} --out {output.features:q} > {log:q} 2>&1"


rule span_tree:
    input:
        features="results/{scheme}/{scene}/features.npy",
    output:
        tree="results/{scheme}/{scene}/tree.npy",
    log:
        "results/logs/{scheme}/{scene}/tree.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/tree.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.tree"),
        options=options(config["method"], "min_samples"),
    message:
        "Computing the spanning tree of {wildcards.scheme}/{wildcards.scene}"
    shell:
        "python -m gspure tree --features {input.features:q} {params.options} --out {output.tree:q} > {log:q} 2>&1"


rule select_clusters:
    input:
        tree="results/{scheme}/{scene}/tree.npy",
    output:
        clusters="results/{scheme}/{scene}/clusters.npz",
    log:
        "results/logs/{scheme}/{scene}/clusters.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/clusters.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.cluster"),
        options=options(config["method"], "min_cluster_size", "selection", "max_cluster_share"),
    message:
        "Selecting clusters in {wildcards.scheme}/{wildcards.scene}"
    shell:
        "python -m gspure cluster --tree {input.tree:q} {params.options} --out {output.clusters:q} > {log:q} 2>&1"


rule decide_pruning:
    input:
        clusters="results/{scheme}/{scene}/clusters.npz",
        weights="results/{scheme}/{scene}/omega.npy",
    output:
        mask="results/{scheme}/{scene}/prune_mask.npy",
        diagnosis="results/{scheme}/{scene}/diagnosis.json",
    log:
        "results/logs/{scheme}/{scene}/prune.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/prune.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.prune"),
        options=factors,
    message:
        "Deciding what to prune in {wildcards.scheme}/{wildcards.scene}"
    shell:
        "python -m gspure prune --clusters {input.clusters:q} --weights {input.weights:q} {params.options}"
        " --out {output.mask:q} --diagnosis {output.diagnosis:q} > {log:q} 2>&1"
