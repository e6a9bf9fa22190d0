"""``gspure attack``: one variant of a model."""

from pathlib import Path
from typing import Any

import numpy as np

from gspure.arrays import save_array
from gspure.attacks import BUILT_IN, Measurements, NotApplicable, find_attack
from gspure.attacks.strength import Damage, scene_damage
from gspure.cli import options
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError
from gspure.images import read_image
from gspure.model import require_writable
from gspure.opencl.device import Device
from gspure.progress import warn
from gspure.public_model import PublicModel
from gspure.schemes.registry import read_public_model
from gspure.settings import DECIBELS, SEED, parsed_settings

EXAMPLES = """\
  gspure attack random_pruning --model point_cloud.ply --set fraction=0.25 --seed 1 --out random/point_cloud.ply
  gspure attack plain_weight --model point_cloud.ply --weights purified/weights.npy --out plain/point_cloud.ply
  gspure attack random_pruning --model point_cloud.ply --damage 1 --cameras cameras.json --out random_1dB.ply
"""

_MEASUREMENTS = {
    "weights": "weights.npy of `gspure purify` or of the workflow",
    "prune_mask": "prune_mask.npy of `gspure purify` or of the workflow",
    "opacities": "opacities.npy of the workflow (default: as stored in the model)",
    "surface": "surface.npy of the workflow",
    "labels": "labels.npy of `gspure purify`, or clusters.npz of the workflow",
}


def add_arguments(parser: Parser) -> None:
    parser.text("name", "NAME", "one of the attacks below, or of an installed plug-in")
    options.list_choices(parser, "attacks", (attack for attack in BUILT_IN if not attack.of_renders))
    parser.reads("--model", "MODEL", "file of the public model; the files beside it are copied")
    measurements = parser.add_argument_group("measurements, for attacks that need them")
    for name, meaning in _MEASUREMENTS.items():
        measurements.add_argument(f"--{name.replace('_', '-')}", type=Path, metavar="FILE", help=meaning)
    parser.number("--seed", "N", "random seed", SEED, 0)
    parser.pairs("--set", "NAME=VALUE", "a setting of the attack")
    parser.writes("--out", "PLY|SPZ", "the attacked model to write")
    parser.writes("--removed", "NPY", "also write the mask of the removed rows: bool [K]", required=False)
    parser.writes("--transform", "NPY", "also write the rigid transform of the attack: float64 [4,4]", required=False)
    parser.text(*options.SCHEME)
    meaning = "search for the strength that lowers the scene's PSNR by DB; needs --cameras"
    parser.number("--damage", "DB", meaning, DECIBELS)
    options.add_cameras(parser, "public views, for attacks that train and for --damage", required=False)
    parser.choice("--split", options.SPLITS, "views that --damage renders", "test")
    meaning = "photographs VIEW.png of the scene, for --damage (default: assume 30 dB for MODEL in every view)"
    parser.reads("--photographs", "DIR", meaning, required=False)
    options.add_device(parser)


def run(args: Arguments) -> None:
    """Write the attacked model and, on request, removed rows and transform."""
    if (attack := find_attack(args.name)).of_renders:
        expected, hint = "an attack on models", "variants of the workflow apply it"
        raise InputError(f"attack {attack.name}", "name", expected=expected, found="one on renders", hint=hint)
    require_writable(args.out)
    settings: dict[str, Any] = parsed_settings(f"attack {attack.name}", attack.function, dict(args.set))
    learns, searches = "teacher" in attack.parameters, args.damage is not None
    if (learns or searches) and not args.cameras:
        raise InputError("attack", "--cameras", expected="public views, which the attack renders", found="none")
    public = read_public_model(args.model, args.scheme).drawable(args.model)
    given = {name: file for name in sorted(attack.needs & _MEASUREMENTS.keys()) if (file := getattr(args, name))}
    measurements = Measurements.read(public, given)
    device = options.read_device(args) if learns or searches else None
    views = options.read_views(args, "train") if learns else []
    known: dict[str, Any] = {"seed": args.seed, "cameras": views, "device": device}
    search = None
    if searches:
        damage = _read_damage(args, public, device)
        search = attack.matching(public, measurements, args.damage, damage, **known, **settings)
        settings[search.setting] = search.value
    attacked = attack.apply(public, measurements, **known, **settings)
    if search:
        estimated = "" if args.photographs else "an estimated "
        drop = f"{search.setting}={search.value:.4g} lowers the scene's PSNR by {estimated}{search.damage:z.2f} dB"
        if search.misses(args.damage):
            warn(f"{args.name}: {drop}, not by {args.damage:g} dB")
        else:
            print(f"{args.name}: {drop}")
    kept, count = int((~attacked.prune_mask).sum()), attacked.count
    if not len(attacked.model):
        raise NotApplicable(attack.name, f"none of {count} rows would remain")
    attacked.published(public, search.comment(args.damage) if search else "").write(args.out)
    if args.removed:
        save_array(args.removed, attacked.prune_mask)
    if args.transform:
        save_array(args.transform, np.eye(4) if attacked.transform is None else attacked.transform)
    args.set = {**attack.settings, **settings}
    options.record_command(args, args.out.parent)
    print(f"{attack.name}: kept {kept} of {count} rows, {len(attacked.model)} in all")


def _read_damage(args: Arguments, public: PublicModel, device: Device | None) -> Damage:
    """Return the function that measures the damage to the scene in the views of ``--cameras``."""
    views, photographs = options.read_views(args, args.split), None
    if args.photographs:
        files = {args.photographs / f"{view.name}.png": (view.width, view.height) for view in views}
        photographs = [read_image(file, size, public.model.background) for file, size in files.items()]
    return scene_damage(public, views, photographs, device)
