# Requirements of the scheduled jobs, checked before the first one starts.

from gspure.plugins import require_packages


def check_requirements():
    """Check optional packages, and the OpenCL device unless jobs run on other machines."""
    jobs = list(workflow.dag.needrun_jobs())
    for scheme in {job.wildcards.scheme for job in jobs if job.rule.name in ("embed_message", "train_clean_model")}:
        require_packages(PLAN.schemes[scheme].packages, f"scheme {scheme}")
    for attack in {get_variant(job.wildcards).attack.name for job in jobs if job.rule.name == "attack_model"}:
        require_packages(find_attack(attack).packages, f"attack {attack}")
    if workflow.local_exec and any("opencl_device" in job.resources.keys() for job in jobs):
        from gspure.opencl.device import choose_device

        choose_device(config["device"])


onstart:
    try:
        check_requirements()
    except InputError as error:
        print(f"gspure: {error}", file=sys.stderr)
        sys.exit(2)
