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
        code=code_digest("gspure.cli.surface"),
        scheme=get_scheme,
    message:
        "Measuring distances from the surface of {wildcards.scheme}/{wildcards.scene}"
    shell:
        job("surface --model {input.model:q} {params.scheme}" " --cameras {input.cameras:q} --out {output.surface:q}")
