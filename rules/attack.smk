rule attack_model:
    input:
        unpack(get_attack_files),
    output:
        model="results/{scheme}/{scene}/{variant}/public/point_cloud.ply",
        removed="results/{scheme}/{scene}/{variant}/prune_mask.npy",
        transform="results/{scheme}/{scene}/{variant}/transform.npy",
        verdict="results/{scheme}/{scene}/{variant}/verdict.json",
    log:
        "results/logs/{scheme}/{scene}/{variant}/attack.log",
    benchmark:
        "results/benchmarks/{scheme}/{scene}/{variant}/attack.tsv"
    wildcard_constraints:
        variant="|".join(VARIANTS),
    conda:
        "../envs/gspure.yaml"
    threads: lambda wildcards: THREADS if get_variant(wildcards).render_files else 1
    resources:
        opencl_device=lambda wildcards: TURNS if get_variant(wildcards).render_files else 0,
    params:
        kernels=lambda wildcards: KERNELS if get_variant(wildcards).render_files else "",
        code=lambda wildcards: get_variant(wildcards).code,
        attack=lambda wildcards: get_variant(wildcards).attack.name,
        options=lambda wildcards: get_variant(wildcards).attack_options,
        cost=lambda wildcards: get_variant(wildcards).cost_options,
    message:
        "Attacking {wildcards.scheme}/{wildcards.scene}: {wildcards.variant}"
    shell:
        job(
            "attack {params.attack:q} --model {input.model:q} {params.options}"
            " --out {output.model:q} --removed {output.removed:q} --transform {output.transform:q}"
            " --verdict {output.verdict:q} {params.cost}"
        )
