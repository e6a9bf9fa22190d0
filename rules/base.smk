# What other rules inherit: a step of rules/steps, not by `script:`, which loads Snakemake in every job, at 0.25 CPU
# seconds; or a command that a person may type.
rule base_step:
    log:
        "results/logs/base_step.log",
    priority: 1
    conda:
        "envs/gspure.yaml"
    threads: get_threads
    resources:
        opencl_device=get_turn,
    params:
        files=files,
    shell:
        logged("python -P $GSPURE_STEPS/{params.step}.py {params.arguments:q} {params.files:q}")


rule base_command:
    log:
        "results/logs/base_command.log",
    priority: 1
    conda:
        "envs/gspure.yaml"
    threads: get_threads
    resources:
        opencl_device=get_turn,
    shell:
        logged("python -m gspure {params.command}")
