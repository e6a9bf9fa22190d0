import os
import shlex
import sys

from gspure.artifacts import file_digest
from gspure.attacks import find_attack
from gspure.workflow.configuration import require_distinct_names, resolved, validated
from gspure.cost import COSTS, LOG, cost_of
from gspure.errors import InputError
from gspure.evaluation.controls import BASELINES, CONTROLS
from gspure.evaluation.detection import files_of
from gspure.evaluation.outcomes import BITS
from gspure.opencl.program import kernel_digest
from gspure.scenes.procedural import DECOYS
from gspure.workflow.captures import capture_files
from gspure.workflow.decisions import DEFAULT
from gspure.workflow.models import OWNER, Model, Plan
from gspure.workflow.options import options, repeated
from gspure.workflow.pairs import pair_arguments, pair_files
from gspure.workflow.sources import code_digest
from gspure.workflow.variants import Decision, Variant

KERNELS = kernel_digest()
TEMPLATE_DIGESTS = []


source = ", ".join(map(os.path.relpath, workflow.configfiles)) or "--config"
try:
    for file in workflow.configfiles:
        require_distinct_names(file)
    config = resolved(validated(config, Path(workflow.basedir) / "schemas" / "config.schema.yaml", source), source)
except InputError as error:
    print(f"gspure: {error}", file=sys.stderr)
    sys.exit(2)

PLAN = Plan(config)
MODELS = [f"{model.scheme}/{model.scene}" for model in PLAN.models]
VARIANTS = config["variants"]

# Jobs on the OpenCL device use all cores, one job at a time; with `threads` set, as many run at once as there are cores.
THREADS = config["threads"] or 16
TURNS = 0 if config["threads"] else 1


wildcard_constraints:
    scheme="|".join(PLAN.scenes),
    scene="[A-Za-z0-9_-]+(?:@[0-9]+)?",
    variant="|".join([*VARIANTS, *CONTROLS]),
    # The folder of a decision below that of its model; empty for the decision of the method.
    decision=f"(?:|/decisions/(?:{'|'.join(config['decisions']) or 'none'}))",


scattergather:
    views=config["views"]["parts"],


# Jobs use the Python of Snakemake, even if it is not on PATH, unless --sdm provides an environment.
prefix = f"export GSPURE_DEVICE={shlex.quote(config['device'])}; " if config["device"] else ""
if not workflow.deployment_settings.deployment_method:
    prefix += f"export PATH={shlex.quote(os.path.dirname(sys.executable))}:$PATH; "
shell.prefix(prefix)


def job(command):
    """Return the shell command of a rule: a gspure command and its log, which ends with the exit status on failure."""
    logged = f"POCL_MAX_PTHREAD_COUNT={{threads}} {LOG}={{log:q}} python -m gspure {command} > {{log:q}} 2>&1"
    return f"{logged} || {{{{ status=$?; echo exit status $status >> {{log:q}}; exit $status; }}}}"


def get_model(wildcards):
    return Model(PLAN, wildcards.scheme, wildcards.scene)


def get_public_model(wildcards):
    return get_model(wildcards).public


def get_scheme(wildcards):
    return get_model(wildcards).scheme_option


def get_variant(wildcards):
    return Variant(get_model(wildcards), wildcards.variant)


def get_decision(wildcards):
    return Decision(get_model(wildcards), wildcards.get("decision", "").rpartition("/")[2] or DEFAULT)


def get_artifact(name):
    """Return the input function of an artifact: that of the first decision with the same settings up to it."""
    return lambda wildcards: get_decision(wildcards).path(name)


def get_method_options(*names):
    """Return the function of some settings of a decision as options."""
    return lambda wildcards: get_decision(wildcards).options(*names)


def get_training_files(wildcards):
    """Return the files that a model is trained from: cameras, points and photographs."""
    settings = config["assets"][wildcards.scene]
    return capture_files(settings["train"], settings["photographs"])


def get_training_options(wildcards):
    settings = config["assets"][wildcards.scene]["training"]
    return options(settings, *settings)


def get_pair_files(wildcards):
    return pair_files(config["pairs"][wildcards.scene])


def get_pair_arguments(wildcards):
    return pair_arguments(config["pairs"][wildcards.scene], config["views"]["off_path"])


def get_message_files(wildcards):
    pair = PLAN.messages[wildcards.message]
    return capture_files(pair["message"], pair["message_photographs"])


def get_pair(wildcards):
    return get_model(wildcards).pair


def get_contributions(wildcards):
    """Return the indices of a decision's contributions, one for each part of the views."""
    return gather.views("{folder}/{scatteritem}.tsv", folder=get_decision(wildcards).path("contributions"))


def get_variant_files(wildcards):
    """Return the model of a variant or control, and the views of the scene or of the message."""
    variant = get_variant(wildcards)
    return {"model": variant.public, **variant.view_files(wildcards.get("target", "scene"))}


def get_view_options(wildcards):
    return get_variant(wildcards).view_options(wildcards.get("target", "scene"))


def get_target(wildcards):
    return "message" if wildcards.owner else "scene"


def get_camera_files(wildcards):
    return get_model(wildcards).camera_files(get_target(wildcards))


def get_detector_files(wildcards):
    """Return the files that the command of a detector names, such as its code and weights, or the key of bits."""
    if wildcards.detector == BITS:
        return [f"{get_model(wildcards).folder}/key"]
    return files_of(config["detectors"][wildcards.detector]["command"])


def get_attack_files(wildcards):
    variant = get_variant(wildcards)
    return {"model": get_public_model(wildcards), **variant.evidence, **variant.render_files}


def get_extractions(model):
    """Return the finished extractions of all variants and controls of a model; baselines have none."""
    names = [name for name in (*VARIANTS, *model.controls) if name not in BASELINES]
    folders = [folder for name in names for folder in Variant(model, name).renders]
    return get_finished(folder for folder in folders if os.path.basename(folder) != "scene")
