import os
import shlex
import sys

from gspure.attacks import find_attack
from gspure.configuration import validated
from gspure.errors import InputError
from gspure.model.inria import point_cloud
from gspure.opencl.program import kernel_digest
from gspure.sources import code_digest

GENERATED = {"orbit", "shells"}
CAMERA_FILES = [
    f"{folder}{name}"
    for folder in ("", "sparse/0/", "sparse/")
    for name in (
        "cameras.bin",
        "images.bin",
        "cameras.txt",
        "images.txt",
        "cameras.json",
        "transforms.json",
    )
]
KERNELS = kernel_digest()


def checked_config():
    """The configuration with its defaults, or one line about what is wrong with it."""
    source = ", ".join(map(str, workflow.configfiles)) or "--config"
    checked = validated(config, Path(workflow.basedir) / "schemas" / "config.schema.yaml", source)
    if not checked["assets"] and not checked["planted"]:
        raise InputError(source, "assets", expected="at least one model", found="none")
    for scene, asset in checked["assets"].items():
        for field in ("model", "cameras"):
            if asset[field] not in GENERATED and not Path(asset[field]).exists():
                raise InputError(
                    source,
                    f"assets.{scene}.{field}",
                    expected="an existing path",
                    found=asset[field],
                )
    for variant, settings in checked["variants"].items():
        known = find_attack(settings.setdefault("attack", variant)).settings
        for name in settings.keys() - known.keys() - {"attack", "seed"}:
            listed = ", ".join(known) or "no settings"
            raise InputError(
                source,
                f"variants.{variant}.{name}",
                expected=f"one of {listed}",
                found="an unknown key",
            )
    return checked


try:
    config = checked_config()
except InputError as error:
    sys.exit(f"gspure: {error}")

SCHEMES = {"planted": config["planted"], "vanilla": config["assets"]}
MODELS = [f"{scheme}/{scene}" for scheme, scenes in SCHEMES.items() for scene in scenes]
VARIANTS = config["variants"]


wildcard_constraints:
    scheme="|".join(SCHEMES),
    scene="[A-Za-z0-9_-]+",
    variant="|".join(VARIANTS),


scattergather:
    views=config["views"]["parts"],


# Jobs run the interpreter that runs Snakemake, also where that is not on PATH; an environment of --sdm is left alone.
if not workflow.deployment_settings.deployment_method:
    shell.prefix(f"export PATH={shlex.quote(os.path.dirname(sys.executable))}:$PATH; ")
if config["device"]:
    os.environ["GSPURE_DEVICE"] = config["device"]


def public_model(wildcards):
    """The model that everybody sees: the planted one, or the user's file where it lies."""
    if wildcards.scheme == "planted":
        return f"results/planted/{wildcards.scene}/public/point_cloud.ply"
    model = Path(config["assets"][wildcards.scene]["model"])
    return str(point_cloud(model) if model.is_dir() else model)


def options(settings, *names):
    """Command-line options for some of `settings`: `--tau-c 4.0 --tau-n 4.0`."""
    words = []
    for name in names:
        value = settings[name]
        words += [
            f"--{name.replace('_', '-')}",
            *(value if isinstance(value, list) else [value]),
        ]
    return shlex.join(map(str, words))
