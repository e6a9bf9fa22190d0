# Features, tree, clusters and mask are separate results, so a sweep repeats only the steps that it changes. Results of further
# decisions are in folders of their own.


rule measure_opacities:
    input:
        model=get_public_model,
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
        scheme=get_scheme,
    message:
        "Computing the opacities of {wildcards.scheme}/{wildcards.scene}"
    shell:
        job(
            "opacities --model {input.model:q} {params.scheme}"
            " --cameras {input.cameras:q} --out {output.opacities:q}"
        )


rule build_features:
    input:
        model=get_public_model,
        weights=get_artifact("weights.npy"),
        opacities="results/{scheme}/{scene}/opacities.npy",
    output:
        features="results/{scheme}/{scene}{decision}/features.npy",
    log:
        "results/logs/{scheme}/{scene}{decision}/features.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}{decision}/features.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.features"),
    message:
        "Standardizing positions, opacities and weights of {wildcards.scheme}/{wildcards.scene}{wildcards.decision}"
    shell:
        job(
            "features --model {input.model:q} --weights {input.weights:q}"
            " --opacities {input.opacities:q} --out {output.features:q}"
        )


rule span_tree:
    input:
        features=get_artifact("features.npy"),
        model=get_public_model,  # recorded as the origin
    output:
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
        code=code_digest("gspure.cli.tree"),
        options=get_method_options("cluster_on", "min_samples"),
    message:
        "Computing the spanning tree of {wildcards.scheme}/{wildcards.scene}{wildcards.decision}"
    shell:
        job("tree --features {input.features:q} {params.options} --out {output.tree:q}")


rule select_clusters:
    input:
        tree=get_artifact("tree.npy"),
        model=get_public_model,  # recorded as the origin
    output:
        clusters="results/{scheme}/{scene}{decision}/clusters.npz",
    log:
        "results/logs/{scheme}/{scene}{decision}/clusters.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}{decision}/clusters.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        kernels=KERNELS,
        code=code_digest("gspure.cli.cluster"),
        options=get_method_options("min_cluster_size", "selection", "max_cluster_share"),
    message:
        "Selecting clusters in {wildcards.scheme}/{wildcards.scene}{wildcards.decision}"
    shell:
        job("cluster --tree {input.tree:q} {params.options} --out {output.clusters:q}")


rule decide_pruning:
    input:
        clusters=get_artifact("clusters.npz"),
        weights=lambda wildcards: get_decision(wildcards).thresholded,
        model=get_public_model,
    output:
        mask="results/{scheme}/{scene}{decision}/prune_mask.npy",
        diagnosis="results/{scheme}/{scene}{decision}/diagnosis.json",
    log:
        "results/logs/{scheme}/{scene}{decision}/prune_mask.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}{decision}/prune_mask.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=code_digest("gspure.cli.prune"),
        options=get_method_options("tau_c", "tau_n"),
    message:
        "Deciding what to prune in {wildcards.scheme}/{wildcards.scene}{wildcards.decision}"
    shell:
        job(
            "prune --clusters {input.clusters:q} --weights {input.weights:q} {params.options}"
            " --model {input.model:q} --out {output.mask:q} --diagnosis {output.diagnosis:q}"
        )
