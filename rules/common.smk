import os
import shlex
import sys

from gspure.attacks import find_attack
from gspure.configuration import GENERATED, resolved, validated
from gspure.errors import InputError
from gspure.evaluation.controls import CONTROLS
from gspure.opencl.program import kernel_digest
from gspure.schemes.registry import find_scheme
from gspure.sources import code_digest

KERNELS = kernel_digest()


source = ", ".join(map(os.path.relpath, workflow.configfiles)) or "--config"
try:
    config = resolved(validated(config, Path(workflow.basedir) / "schemas" / "config.schema.yaml", source), source)
except InputError as error:
    print(f"gspure: {error}", file=sys.stderr)
    sys.exit(2)

# By scheme, the scenes of each: planted messages, the user's own models, and pairs that schemes are trained on.
WATERMARKS = {name: find_scheme(name) for name in config["schemes"]}
SCHEMES = {"planted": config["planted"], "vanilla": config["assets"], **dict.fromkeys(WATERMARKS, config["pairs"])}
MODELS = [f"{scheme}/{scene}" for scheme, scenes in SCHEMES.items() for scene in scenes]
VARIANTS = config["variants"]

# Jobs on the OpenCL device take all cores and turns; with `threads` set, as many go side by side as there are cores.
THREADS = config["threads"] or 16
TURNS = 0 if config["threads"] else 1


wildcard_constraints:
    scheme="|".join(SCHEMES),
    scene="[A-Za-z0-9_-]+",
    variant="|".join([*VARIANTS, *CONTROLS]),


scattergather:
    views=config["views"]["parts"],


# Jobs run the interpreter that runs Snakemake, also where that is not on PATH; an environment of --sdm is left alone.
prefix = f"export GSPURE_DEVICE={shlex.quote(config['device'])}; " if config["device"] else ""
if not workflow.deployment_settings.deployment_method:
    prefix += f"export PATH={shlex.quote(os.path.dirname(sys.executable))}:$PATH; "
shell.prefix(prefix)


def options(settings, *names):
    """Command-line options for some of `settings`: `--tau-c 4.0 --tau-n 4.0`; none for one that is null."""
    words = []
    for name in names:
        if (value := settings[name]) is not None:
            words += [f"--{name.replace('_', '-')}", *(value if isinstance(value, list) else [value])]
    return shlex.join(map(str, words))
