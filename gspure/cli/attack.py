"""``gspure attack``: one variant of a model."""

from __future__ import annotations

import argparse
from pathlib import Path

from gspure.cli.options import add_scheme, read_public

HELP = "attack a model (or apply a control): remove, change or move its Gaussians"
EXAMPLES = """\
  gspure attack random_pruning --model point_cloud.ply --set fraction=0.25 --seed 1 --out random.ply
  gspure attack gspure --model point_cloud.ply --prune-mask prune_mask.npy --out purified.ply
  gspure attack plain_weight --model point_cloud.ply --weights weights.npy --set tau=4 --out plain.ply
  gspure attack rigid_transform --model point_cloud.ply --set angle=90 --out moved.ply --world world.npy
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    from gspure.attacks.registry import BUILT_IN
    from gspure.cli.options import described

    names = ", ".join(described(attack.name, attack.settings) for attack in BUILT_IN)
    parser.add_argument("name", metavar="NAME", help=f"one of {names}, or one of an installed plug-in")
    parser.add_argument("--model", type=Path, required=True, help="the public model's .ply; its other files are copied")
    parser.add_argument("--weights", type=Path, metavar="NPY", help="from `gspure weights`, if the attack needs them")
    parser.add_argument("--prune-mask", type=Path, metavar="NPY", help="from `gspure prune`, if the attack needs it")
    parser.add_argument(
        "--opacities",
        type=Path,
        metavar="NPY",
        help="from `gspure opacities`, if the attack needs them (default: as stored in the model)",
    )
    parser.add_argument("--surface", type=Path, metavar="NPY", help="from `gspure surface`, if the attack needs it")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="random seed (default: %(default)s)")
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="a setting of the attack; repeatable"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="PLY", help="the attacked model")
    parser.add_argument("--removed", type=Path, metavar="NPY", help="also write the mask of the removed rows: bool [K]")
    add_scheme(parser)
    parser.add_argument(
        "--verdict",
        type=Path,
        metavar="JSON",
        help="also write whether the attack changed the carrier of each extraction",
    )
    parser.add_argument(
        "--world", type=Path, metavar="NPY", help="also write the rigid transform applied: float64 [4,4]"
    )


def run(args: argparse.Namespace) -> None:
    """Write the attacked model, and optionally removed rows, verdict and transform."""
    import numpy as np

    from gspure.artifacts import load_array, require_made_from, save_array, write_json, write_provenance
    from gspure.attacks import Evidence, find_attack
    from gspure.attacks.carrier import reached
    from gspure.cli.options import parsed_settings, require_distinct
    from gspure.schemes.registry import find_scheme

    attack = find_attack(args.name)
    settings = parsed_settings(f"attack {attack.name}", attack.settings, args.set)
    files = {name: getattr(args, name) for name in sorted(attack.needs) if getattr(args, name)}
    outputs = [path for path in (args.out, args.removed, args.world, args.verdict) if path]
    require_distinct(outputs, [args.model, *files.values()])
    require_made_from(args.model, *files.values())
    public = read_public(args)
    model = public.model
    types = {"weights": np.float32, "prune_mask": np.bool_, "opacities": np.float32, "surface": np.float32}
    loaded = {name: load_array(path, dtype=types[name], shape=(len(model),), least=0) for name, path in files.items()}
    stored = {"opacities": model.opacities} if public.rows_are_gaussians else {}
    attacked = attack.apply(public, Evidence(**stored | loaded), seed=args.seed, **settings)
    public.with_model(attacked.model).write(args.out)
    if args.removed:
        save_array(args.removed, attacked.prune_mask)
    if args.world:
        save_array(args.world, np.eye(4) if attacked.world is None else attacked.world)
    if args.verdict:
        carriers = find_scheme(args.scheme).extractions if args.scheme else {}
        touched = {name: reached(model, attacked, columns) for name, columns in carriers.items()}
        write_json(args.verdict, {"reached": touched})
    applied = {"attack": attack.name, "seed": args.seed, **attack.settings, **settings}
    for path in outputs:
        write_provenance(path, inputs={"model": args.model, **files}, settings=applied)
    print(f"{attack.name}: kept {int((~attacked.prune_mask).sum())} of {len(model)} rows, {len(attacked.model)} in all")
