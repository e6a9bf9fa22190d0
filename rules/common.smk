import fcntl
import os
import re
import shlex
import sys
from contextlib import suppress

import gspure
from gspure import codec
from gspure.attacks import find_attack
from gspure.errors import InputError
from gspure.evaluation.plan import CONFIGURATION, PLAN_FILE
from gspure.files import write_json, write_text
from gspure.metrics.names import CLEAN, clean_seed
from gspure.model.copies import COPIES, STORED
from gspure.plugins import require_packages
from gspure.schemes.registry import find_scheme
from gspure.workflow.config_reading import read_config
from gspure.workflow.decisions import decision_folders
from gspure.workflow.planning import VANILLA, plan_of
from gspure.workflow.sources import code_digest, files_digest, note_inputs, write_inputs


def refuse(reason):
    print(f"gspure: {reason}", file=sys.stderr)
    sys.exit(2)


# Every Snakemake that runs here holds this lock as long as it lives; by it, `gspure audit` tells the lock that a killed
# one left behind from that of a running one.
with suppress(OSError):
    os.makedirs(".snakemake", exist_ok=True)
    ALIVE = open(".snakemake/gspure.lock", "w")
    fcntl.flock(ALIVE, fcntl.LOCK_SH | fcntl.LOCK_NB)

source = ", ".join(map(os.path.relpath, workflow.configfiles)) or "--config"
try:
    # Read again from the files: Snakemake takes the keys `no` and `2024_05` for False and 202405.
    CONFIG = read_config(map(Path, workflow.configfiles), workflow.config_settings.config, source)
    PLAN = plan_of(CONFIG, source)
except InputError as error:
    refuse(error)

note_inputs(PLAN.users_files)  # what changes later would mix results of two contents: steps refuse it
MODELS = [*PLAN.by_name]
VARIANTS = [job.variant for job in PLAN.models[0].variants]
WATERMARKED = "|".join(PLAN.schemes) or "none"
DECISIONS = decision_folders(CONFIG.decisions)


wildcard_constraints:
    scheme="|".join(dict.fromkeys(model.id.scheme for model in PLAN.models)),
    scene="|".join(dict.fromkeys([*PLAN.pairs, *(model.id.folder_name for model in PLAN.models)])),
    variant="|".join(map(re.escape, VARIANTS)),
    clean=rf"{CLEAN}(_\d+)?",
    decision=f"(?:{'|'.join(DECISIONS)})",


scattergather:
    views=CONFIG.views.parts,


# Jobs use the Python of Snakemake, even if it is not on PATH, unless --sdm provides an environment.
STEPS = Path(workflow.basedir) / "rules" / "steps"
prefix = f"export GSPURE_STEPS={shlex.quote(str(STEPS))} {COPIES}={STORED}; "
if CONFIG.device:
    prefix += f"export GSPURE_DEVICE={shlex.quote(CONFIG.device)}; "
if workflow.deployment_settings.deployment_method:
    prefix += f"export PYTHONPATH={shlex.quote(os.path.dirname(os.path.dirname(gspure.__file__)))}; "
else:
    prefix += f"export PATH={shlex.quote(os.path.dirname(sys.executable))}:$PATH; "
# Most matrix products are of points and 3 x 3 matrices, for which a second thread of OpenBLAS only waits, busily.
prefix += "export OPENBLAS_NUM_THREADS=${{OPENBLAS_NUM_THREADS:-1}}; "
shell.prefix(prefix)


def start():
    """Write down configuration and plan, for the report, and refuse to start without the packages that jobs need."""
    if workflow.local_exec:
        # The limit of jobs per second, which only clusters need, wakes the scheduler once a second more for every job that
        # has ended: after 150 jobs, it takes a quarter of a core (snakemake/snakemake#2967).
        workflow.scheduler.job_rate_limiter = None
    write_json(Path("results") / CONFIGURATION, codec.plain(CONFIG))
    write_text(Path("results") / PLAN_FILE, codec.text(PLAN))  # keeps the order of mappings
    write_inputs()
    try:
        for name in PLAN.schemes:
            require_packages(find_scheme(name).packages, f"scheme {name}")
        for job in PLAN.models[0].variants:
            require_packages(find_attack(job.case.name).packages, f"attack {job.case.name}")
    except InputError as error:
        refuse(error)


def logged(program):
    """Return the shell command of a rule; the last line of its log is the reason of a failure."""
    killed = 'echo "killed by signal $((status - 128))" >> {log:q}'
    failed = f"{{{{ status=$?; [ $status -lt 128 ] || {killed}; exit $status; }}}}"
    # A job of small images also takes a core that others leave idle: a second thread costs no processor time.
    least = 1 if CONFIG.threads else 2
    threads = f"$(({{threads}} > {least} ? {{threads}} : {least}))"
    job = "GSPURE_JOB={log:q}"  # by which `gspure audit` knows the job that reports its progress
    # glibc keeps the memory of large arrays for the next ones: fresh pages take a fifth of a job's processor time.
    memory = "MALLOC_MMAP_THRESHOLD_=1073741824 MALLOC_TRIM_THRESHOLD_=1073741824"
    return f"{job} {memory} POCL_MAX_PTHREAD_COUNT={threads} {program} > {{log:q}} 2>&1 || {failed}"


def step(name, version=None, **settings):
    """Return the parameters of a rule that runs rules/steps/NAME.py, beside `files`.

    Settings are values, or functions of wildcards. Snakemake runs a job again when they change, or the version: a digest
    of the step, the scheme and the user's model, so that a replaced file counts even if it is older. It ignores parameters
    that it derives from files, as `files` is.
    """

    def version_of(wildcards):
        model = get_model(wildcards)
        return f"{code_of(name, *model.modules)} {files_digest(model.users_files)}"

    def text_of(wildcards):
        return codec.text({key: value(wildcards) if callable(value) else value for key, value in settings.items()})

    return {"step": name, "version": version or version_of, "arguments": text_of}


def job_parameters(get_jobs):
    """Return the parameters of a rule that evaluates jobs, beside `files`."""

    def version(wildcards):
        modules = {module for job in get_jobs(wildcards) for module in job.modules}
        users_files = dict.fromkeys(file for job in get_jobs(wildcards) for file in job.users_files)
        return f"{code_of('evaluate', *sorted(modules))} {files_digest(users_files)}"

    return step("evaluate", version=version, jobs=get_jobs)


def files(wildcards, input, output):
    """Return the named inputs and outputs of a step, as JSON."""
    return codec.text({**dict(input.items()), **dict(output.items())})


def command(name, *words, **options):
    """Return a gspure command as words for the shell: lists are several values, mappings repeat an option."""
    words = [name, *words]
    for option, value in options.items():
        values = value if isinstance(value, list) else [value]
        pairs = [[f"{key}={each}"] for key, each in value.items()] if isinstance(value, dict) else [values]
        for values in pairs if value is not None else []:
            words += [f"--{option.replace('_', '-')}", *values]
    return shlex.join(map(str, words))


def code_of(name, *modules):
    """Return a digest of the code of a step, or of a command, and of further modules."""
    file = STEPS / f"{name}.py"
    return code_digest(file if file.is_file() else f"gspure.cli.{name}", *modules)


def get_threads(wildcards):
    """Return the threads of a job on an OpenCL CPU; jobs of small images, with one each, run side by side."""
    if CONFIG.threads:
        return CONFIG.threads
    if wildcards.get("scheme"):
        subject = get_model(wildcards)
    else:
        subject = PLAN.pairs.get(wildcards.get("scene", ""))
    return 1 if subject and subject.has_small_images else 16


def get_turn(wildcards, threads):
    """Return whether a job waits until it has the OpenCL device for itself."""
    return int(threads > 1 and not CONFIG.threads)


def get_model(wildcards):
    return PLAN.by_name[f"{wildcards.scheme}/{wildcards.scene}"]


def get_public_model(wildcards):
    return get_model(wildcards).public


def get_made_model(wildcards):
    """Return the public model if a job makes it; files of the user's count by their digest instead."""
    return get_model(wildcards).inputs


def get_scheme(wildcards):
    owner = get_model(wildcards).owner
    return owner.scheme if owner else None


def get_decision(wildcards):
    return get_model(wildcards).decisions[DECISIONS[wildcards.decision]]


def get_artifact(name):
    """Return the input function of a file of a decision: that of the first one with the same settings up to it."""
    return lambda wildcards: get_decision(wildcards).files[name]


def get_settings(*names):
    """Return a setting of a decision for each name, as functions of wildcards."""
    return {name: lambda wildcards, name=name: getattr(get_decision(wildcards).settings, name) for name in names}


def get_clean_training(wildcards):
    """Return the command that trains a clean model, each with its own random seed."""
    seed = get_model(wildcards).embedding.seed + clean_seed(wildcards.clean)
    return get_embedding(wildcards, "results/{scheme}/{scene}/{clean}", seed=seed, message_weight=0)


def get_embedding(wildcards, out, seed=None, **changes):
    """Return the command that trains a model with the scheme's settings and some changes."""
    embedding = get_model(wildcards).embedding
    return command(
        *("embed", wildcards.scheme, embedding.pair, "--force"),
        out=out.format(**wildcards),
        seed=embedding.seed if seed is None else seed,
        initialization=embedding.initialization,
        set={**embedding.settings, **changes},
    )


def get_job(wildcards):
    return [get_model(wildcards).by_variant[wildcards.variant]]


def get_controls(wildcards):
    return [*get_model(wildcards).controls]


def get_inputs(get_jobs):
    """Return the input function of the files that other jobs make for some jobs."""
    return lambda wildcards: [*dict.fromkeys(file for job in get_jobs(wildcards) for file in job.inputs)]


def get_revealing_owner(wildcards):
    """Return the owner if the key tells which rows show the message."""
    owner = get_model(wildcards).owner
    return owner if owner and owner.reveals else None


def get_revealing_files(wildcards):
    """Return the files of that owner which other jobs make."""
    model = get_model(wildcards)
    if get_revealing_owner(wildcards) is None:
        return []
    return [model.owner.message_cameras, *([model.owner.key] if model.embedding else [])]
