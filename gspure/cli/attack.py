"""``gspure attack``: one variant of a model."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from gspure.errors import InputError

if TYPE_CHECKING:
    from gspure.attacks.attack import Attack, Setting

HELP = "attack a model: remove Gaussians, scale colours, add noise; and controls"
EXAMPLES = """\
  gspure attack random_pruning --model point_cloud.ply --set fraction=0.25 --seed 1 --out random.ply
  gspure attack gspure --model point_cloud.ply --prune-mask prune_mask.npy --out purified.ply --kept kept.npy
  gspure attack plain_weight --model point_cloud.ply --weights omega.npy --set tau=4 --out plain.ply
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    from gspure.attacks.registry import BUILT_IN

    names = ", ".join(_described(attack) for attack in BUILT_IN)
    parser.add_argument("name", metavar="NAME", help=f"one of {names}, or one of an installed plug-in")
    parser.add_argument("--model", type=Path, required=True, help="3DGS .ply")
    parser.add_argument("--weights", type=Path, metavar="NPY", help="of `gspure weights`, for attacks that need them")
    parser.add_argument("--prune-mask", type=Path, metavar="NPY", help="of `gspure prune`, for attacks that need it")
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of what is random (default: %(default)s)"
    )
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="a setting of the attack; may be repeated"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="PLY", help="the attacked model")
    parser.add_argument("--kept", type=Path, metavar="NPY", help="also write which rows it kept: bool [K]")


def run(args: argparse.Namespace) -> None:
    """Attack, and write the model and which rows it kept."""
    import numpy as np

    from gspure.artifacts import load_array, save_array, write_provenance
    from gspure.attacks import Evidence, find_attack
    from gspure.model import require_finite, write_model
    from gspure.model.ply import read_ply

    attack = find_attack(args.name)
    settings = dict(_parsed(attack, text) for text in args.set)
    model = read_ply(args.model)
    require_finite(model, args.model)
    files = {name: getattr(args, name) for name in sorted(attack.needs) if getattr(args, name)}
    types = {"weights": np.float32, "prune_mask": np.bool_}
    loaded = {name: load_array(path, dtype=types[name], shape=(len(model),)) for name, path in files.items()}
    attacked = attack.apply(model, Evidence(**loaded), seed=args.seed, **settings)
    write_model(args.out, attacked.model)
    if args.kept:
        save_array(args.kept, attacked.kept)
    said = {"attack": attack.name, "seed": args.seed, **attack.settings, **settings}
    write_provenance(args.out, inputs={"model": args.model, **files}, settings=said)
    print(f"{attack.name}: kept {int(attacked.kept.sum())} of {len(model)} Gaussians")


def _described(attack: Attack) -> str:
    settings = ", ".join(f"{name}={value}" for name, value in attack.settings.items())
    return f"{attack.name} ({settings})" if settings else attack.name


def _parsed(attack: Attack, text: str) -> tuple[str, Setting]:
    """Return one setting, in the type of its default."""
    name, _, value = text.partition("=")
    default = attack.settings.get(name, "")
    try:
        return name, type(default)(value)
    except ValueError:
        expected = "a whole number" if isinstance(default, int) else "a number"
        raise InputError(f"attack {attack.name}", name, expected=expected, found=repr(value)) from None
