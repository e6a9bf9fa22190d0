# Pairs, and the models that schemes train on them. A clean model, trained without the message, is a control.


rule make_pair:
    input:
        get_pair_files,
    output:
        cameras="results/pairs/{scene}/cameras.json",
        points="results/pairs/{scene}/points3D.ply",
        scene=directory("results/pairs/{scene}/scene"),
        message=directory("results/pairs/{scene}/message"),
    log:
        "results/logs/pairs/{scene}/pair.log",
    benchmark:
        "results/benchmarks/pairs/{scene}/pair.tsv"
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    resources:
        opencl_device=TURNS,
    params:
        kernels=KERNELS,
        code=code_digest("gspure.cli.pair"),
        folder="results/pairs/{scene}",
        arguments=get_pair_arguments,
    message:
        "Making pair {wildcards.scene}"
    shell:
        job("pair {params.arguments} --out {params.folder:q}")


rule train_message:
    input:
        data=get_message_files,
    output:
        model=directory("results/messages/{message}"),
    log:
        "results/logs/messages/{message}.log",
    benchmark:
        "results/benchmarks/messages/{message}.tsv"
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    resources:
        opencl_device=TURNS,
    params:
        kernels=KERNELS,
        code=code_digest("gspure.cli.train"),
        data=lambda wildcards: PLAN.messages[wildcards.message]["message"],
        options=lambda wildcards: options(PLAN.messages[wildcards.message], "iterations", "resolution", "seed"),
    message:
        "Training a model of message {wildcards.message}"
    shell:
        job("train {params.data:q} {params.options} --out {output.model:q}")


rule embed_message:
    input:
        unpack(get_pair),
    output:
        model="results/{scheme}/{scene}/public/point_cloud.ply",
        key=directory("results/{scheme}/{scene}/key"),
    log:
        "results/logs/{scheme}/{scene}/embed.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/embed.tsv"
    wildcard_constraints:
        scheme="|".join(PLAN.schemes) or "none",
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    resources:
        opencl_device=TURNS,
    params:
        kernels=KERNELS,
        code=lambda wildcards: get_model(wildcards).code("embed"),
        pair=lambda wildcards, input: os.path.dirname(input.cameras),
        folder="results/{scheme}/{scene}",
        options=lambda wildcards: get_model(wildcards).embedding_options(),
    message:
        "Embedding the message of {wildcards.scene} with {wildcards.scheme}"
    shell:
        job("embed {wildcards.scheme} {params.pair:q} {params.options}" " --out {params.folder:q}")


use rule embed_message as train_clean_model with:
    output:
        model="results/{scheme}/{scene}/clean/public/point_cloud.ply",
    log:
        "results/logs/{scheme}/{scene}/clean/embed.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/clean/embed.tsv"
    params:
        folder="results/{scheme}/{scene}/clean",
        options=lambda wildcards: get_model(wildcards).embedding_options(message_weight=0),
    message:
        "Training {wildcards.scheme} on {wildcards.scene} without a message"


rule measure_hidden_weights:
    input:
        model="results/{scheme}/{scene}/public/point_cloud.ply",
        key="results/{scheme}/{scene}/key",
        cameras="results/{scheme}/{scene}/message_cameras.json",
        weights="results/{scheme}/{scene}/weights.npy",
    output:
        share="results/{scheme}/{scene}/hidden.json",
        hidden="results/{scheme}/{scene}/hidden.npy",
    log:
        "results/logs/{scheme}/{scene}/hidden.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/hidden.tsv"
    wildcard_constraints:
        scheme="|".join(PLAN.schemes) or "none",
    conda:
        "../envs/gspure.yaml"
    threads: THREADS
    resources:
        opencl_device=TURNS,
    params:
        kernels=KERNELS,
        code=lambda wildcards: get_model(wildcards).code("hidden"),
        options=get_method_options("energy", "reduction", "tau_n"),
    message:
        "Measuring the weights of the message of {wildcards.scheme}/{wildcards.scene}"
    shell:
        job(
            "hidden --model {input.model:q} --scheme {wildcards.scheme}"
            " --key {input.key:q} --cameras {input.cameras:q} --weights {input.weights:q} {params.options}"
            " --out {output.share:q} --hidden {output.hidden:q}"
        )
