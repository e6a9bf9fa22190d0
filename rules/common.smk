import os
import shlex
import sys

from gspure.artifacts import file_digest
from gspure.attacks import find_attack
from gspure.workflow.configuration import GENERATED, resolved, validated
from gspure.errors import InputError
from gspure.evaluation.controls import CONTROLS
from gspure.opencl.program import kernel_digest
from gspure.report.templates import TEMPLATES
from gspure.schemes.registry import find_scheme
from gspure.workflow.options import column_options, options, setting_options
from gspure.workflow.sources import code_digest

KERNELS = kernel_digest()
TEMPLATE_DIGESTS = [file_digest(path) for path in TEMPLATES]


source = ", ".join(map(os.path.relpath, workflow.configfiles)) or "--config"
try:
    config = resolved(validated(config, Path(workflow.basedir) / "schemas" / "config.schema.yaml", source), source)
except InputError as error:
    print(f"gspure: {error}", file=sys.stderr)
    sys.exit(2)

# By scheme, the scenes of each: the user's own models, and pairs that schemes are trained on. `raised@1` is the pair
# `raised` again, with other seeds.
WATERMARKS = {name: find_scheme(name) for name in config["schemes"]}
REPEATED = {
    f"{pair}@{n}" if n else pair: own for pair, own in config["pairs"].items() for n in range(config["repetitions"])
}
SCHEMES = {"vanilla": config["assets"], **dict.fromkeys(WATERMARKS, REPEATED)}
MODELS = [f"{scheme}/{scene}" for scheme, scenes in SCHEMES.items() for scene in scenes]
VARIANTS = config["variants"]

# Jobs on the OpenCL device take all cores and turns; with `threads` set, as many go side by side as there are cores.
THREADS = config["threads"] or 16
TURNS = 0 if config["threads"] else 1


wildcard_constraints:
    scheme="|".join(SCHEMES),
    scene="[A-Za-z0-9_-]+(?:@[0-9]+)?",
    variant="|".join([*VARIANTS, *CONTROLS]),


scattergather:
    views=config["views"]["parts"],


# Jobs run the interpreter that runs Snakemake, also where that is not on PATH; an environment of --sdm is left alone.
prefix = f"export GSPURE_DEVICE={shlex.quote(config['device'])}; " if config["device"] else ""
if not workflow.deployment_settings.deployment_method:
    prefix += f"export PATH={shlex.quote(os.path.dirname(sys.executable))}:$PATH; "
shell.prefix(prefix)


def job(command):
    """The shell command of a rule: a command of gspure with its log, which tells the exit status if it fails."""
    logged = f"POCL_MAX_PTHREAD_COUNT={{threads}} python -m gspure {command} > {{log:q}} 2>&1"
    return f"{logged} || {{{{ status=$?; echo exit status $status >> {{log:q}}; exit $status; }}}}"


def get_scheme(wildcards):
    """The option that names the scheme of a public model; other models are recognized by their columns."""
    return f"--scheme {wildcards.scheme}" if wildcards.scheme in WATERMARKS else ""
