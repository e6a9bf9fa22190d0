EVIDENCE = {
    "weights": "results/{scheme}/{scene}/omega.npy",
    "prune_mask": "results/{scheme}/{scene}/prune_mask.npy",
}


def attack_of(wildcards):
    """The attack behind a variant."""
    return find_attack(VARIANTS[wildcards.variant]["attack"])


def attack_input(wildcards):
    """The public model, and what the attack has measured on it."""
    evidence = {need: EVIDENCE[need].format(**wildcards) for need in sorted(attack_of(wildcards).needs)}
    return {"model": public_model(wildcards), **evidence}


def attack_options(wildcards, input):
    """The evidence, the seed and the settings of a variant."""
    settings = VARIANTS[wildcards.variant]
    given = {name: path for name, path in input.items() if name in EVIDENCE}
    assigned = [f"{name}={value}" for name, value in settings.items() if name not in {"attack", "seed"}]
    return options({**given, "seed": settings["seed"]}, *given, "seed") + "".join(
        f" --set {shlex.quote(a)}" for a in assigned
    )


rule attack_model:
    input:
        unpack(attack_input),
    output:
        model="results/{scheme}/{scene}/{variant}/public/point_cloud.ply",
        kept="results/{scheme}/{scene}/{variant}/kept.npy",
    log:
        "results/logs/{scheme}/{scene}/{variant}/attack.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/{variant}/attack.tsv"
    conda:
        "../envs/gspure.yaml"
    params:
        code=lambda wildcards: code_digest("gspure.cli.attack", attack_of(wildcards).function.__module__),
        attack=lambda wildcards: attack_of(wildcards).name,
        options=attack_options,
    message:
        "Making variant {wildcards.variant} of {wildcards.scheme}/{wildcards.scene}"
    shell:
        "python -m gspure attack {params.attack:q} --model {input.model:q} {params.options}"
        " --out {output.model:q} --kept {output.kept:q} > {log:q} 2>&1"
