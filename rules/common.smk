import fcntl
import json
import os
import shlex
import sys
from contextlib import suppress

from snakemake.exceptions import WorkflowError
from snakemake.utils import validate

import gspure
from gspure.attacks import find_attack
from gspure.errors import InputError, printable
from gspure.files import write_json
from gspure.plugins import require_packages
from gspure.scenes.procedural import DECOYS
from gspure.workflow.configuration import resolve
from gspure.workflow.decisions import METHOD
from gspure.workflow.inputs import capture_files, is_small, message_model, pair_files, pair_of, pair_settings
from gspure.workflow.plan import VANILLA, Model, Plan
from gspure.workflow.sources import code_digest, files_digest
from gspure.workflow.variants import Variant, evaluation, report_plan


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
    validate(config, "../schemas/config.schema.yaml")
    config = resolve(config, source)
except InputError as error:
    refuse(error)
except WorkflowError as error:
    fault = error.__context__  # of jsonschema
    refuse(f"{source}: {fault.json_path.removeprefix('$.')}: {printable(fault.message)}")

PLAN = Plan(config)
MODELS = [f"{model.scheme}/{model.scene}" for model in PLAN.models]
VARIANTS = config["variants"]
WATERMARKED = "|".join(PLAN.schemes) or "none"


wildcard_constraints:
    scheme="|".join(PLAN.scenes),
    scene="|".join(dict.fromkeys([*config["pairs"], *(model.scene for model in PLAN.models)])),
    variant="|".join(VARIANTS),
    # The folder of a decision below that of its model; empty for the decision of the method.
    decision=f"(?:|/decisions/(?:{'|'.join(config['decisions']) or 'none'}))",


scattergather:
    views=config["views"]["parts"],


# Jobs use the Python of Snakemake, even if it is not on PATH, unless --sdm provides an environment.
STEPS = Path(workflow.basedir) / "rules" / "steps"
prefix = f"export GSPURE_STEPS={shlex.quote(str(STEPS))}; "
if config["device"]:
    prefix += f"export GSPURE_DEVICE={shlex.quote(config['device'])}; "
if workflow.deployment_settings.deployment_method:
    prefix += f"export PYTHONPATH={shlex.quote(os.path.dirname(os.path.dirname(gspure.__file__)))}; "
else:
    prefix += f"export PATH={shlex.quote(os.path.dirname(sys.executable))}:$PATH; "
shell.prefix(prefix)


def start():
    """Write down the configuration, for the report, and refuse to start without the packages that jobs need."""
    write_json(Path("results/configuration.json"), config)
    try:
        for name, scheme in PLAN.schemes.items():
            require_packages(scheme.packages, f"scheme {name}")
        for settings in VARIANTS.values():
            require_packages(find_attack(settings["attack"]).packages, f"attack {settings['attack']}")
    except InputError as error:
        refuse(error)


def logged(program):
    """Return the shell command of a rule; the last line of its log is the reason of a failure."""
    killed = 'echo "killed by signal $((status - 128))" >> {log:q}'
    failed = f"{{{{ status=$?; [ $status -lt 128 ] || {killed}; exit $status; }}}}"
    # A job of small images also takes a core that others leave idle: a second thread costs no processor time.
    least = 1 if config["threads"] else 2
    threads = f"$(({{threads}} > {least} ? {{threads}} : {least}))"
    job = "GSPURE_JOB={log:q}"  # by which `gspure audit` knows the job that reports its progress
    return f"{job} POCL_MAX_PTHREAD_COUNT={threads} {program} > {{log:q}} 2>&1 || {failed}"


def step(name, *groups, version=None, **single):
    """Return the parameters of a rule that runs rules/steps/NAME.py, beside `files`.

    `groups` and `single` are settings, or functions of wildcards. Snakemake runs a job again when they change, or the
    version: a digest of the step, the scheme and the user's model, so that a replaced file counts even if it is older.
    It ignores parameters that it derives from files, as `files` is.
    """

    def version_of(wildcards):
        model = get_model(wildcards)
        return f"{code_of(name, model.module)} {files_digest(model.users_files)}"

    def settings(wildcards):
        chosen = {key: value(wildcards) if callable(value) else value for key, value in single.items()}
        for group in groups:
            chosen |= group(wildcards)
        return json.dumps(chosen)

    return {"step": name, "version": version or version_of, "settings": settings}


def files(wildcards, input, output):
    """Return the named inputs and outputs of a step, as JSON."""
    return json.dumps({**dict(input.items()), **dict(output.items())})


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
    pair = None if wildcards.get("scheme") == VANILLA else config["pairs"].get(pair_of(wildcards.get("scene", "")))
    return config["threads"] or (1 if pair and is_small(pair) else 16)


def get_turn(wildcards, threads):
    """Return whether a job waits until it has the OpenCL device for itself."""
    return int(threads > 1 and not config["threads"])


def get_model(wildcards):
    return Model(PLAN, wildcards.scheme, wildcards.scene)


def get_variant(wildcards):
    return Variant(get_model(wildcards), wildcards.variant)


def get_public_model(wildcards):
    return get_model(wildcards).public


def get_scheme(wildcards):
    return wildcards.scheme if get_model(wildcards).is_watermarked else None


def get_decision(wildcards):
    return wildcards.decision.rpartition("/")[2] or METHOD


def get_made(name):
    """Return the input function of what is made for a decision: that of the first one with the same settings up to it."""
    return lambda wildcards: get_model(wildcards).path(name, get_decision(wildcards))


def get_settings(*names):
    """Return the function of some settings of a decision."""
    return lambda wildcards: {name: get_model(wildcards).decision(get_decision(wildcards))[name] for name in names}


def get_pair(wildcards):
    return PLAN.config["pairs"][pair_of(wildcards.scene)]


def get_message_files(wildcards):
    pair = PLAN.messages[wildcards.message]
    return capture_files(pair["message"], pair["message_photographs"])


def get_training_files(wildcards):
    asset = config["assets"][wildcards.scene]
    return capture_files(asset["train"], asset["photographs"])


def get_embedding(wildcards, out, **changes):
    """Return the command that trains a model with the scheme's settings and some changes."""
    settings = dict(get_model(wildcards).embed_settings)
    settings["set"] = {**settings["set"], **changes}
    return command(
        *("embed", wildcards.scheme, get_model(wildcards).pair, "--force"), out=out.format(**wildcards), **settings
    )


def get_evaluated_files(model, names):
    """Return the files that the evaluation of variants or controls reads."""
    variants = [Variant(model, name) for name in names]
    files = [f"{model.folder}/cameras.json", *([] if model.is_users else model.decoys)]
    files += [file for variant in variants for file in variant.users_files]
    files += [file for v in variants for file in ([*v.measured.values()] if v.is_attacked else [v.public])]
    files += [model.public, *(model.owned.values() if model.is_watermarked else ())]
    if not model.is_users:
        files += [f"{model.pair}/scene", f"{model.pair}/message"]
    if "unattacked" not in names and (model.is_users or not variants[0].is_attacked):
        files += [f"{model.folder}/unattacked/renders"]
    return [*dict.fromkeys(files)]
