"""``gspure attack``: one variant of a model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gspure.artifacts import (
    UNMOVED,
    facts_of,
    load_array,
    motion_of,
    require_kind,
    save_array,
    write_json,
    write_record,
)
from gspure.attacks import Attacked, Evidence, NotApplicable, find_attack
from gspure.attacks.carrier import reached
from gspure.attacks.registry import BUILT_IN
from gspure.attacks.strength import Damage, Match, scene_damage
from gspure.cameras import Camera, split
from gspure.cli.options import (
    SPLITS,
    add_cameras,
    add_device,
    add_scheme,
    described,
    read_device,
    read_public,
    read_source,
    read_split,
)
from gspure.cli.parser import Arguments, Parser
from gspure.cost import read_cost, spent, total
from gspure.errors import InputError
from gspure.evaluation.comparison import RENDER, TRUTH
from gspure.evaluation.origins import attacks_of
from gspure.evaluation.outcomes import SCENE
from gspure.files import Float64
from gspure.images import read_image, require_photographs
from gspure.method.clustering.store import read_labels
from gspure.model import model_file, require_writable
from gspure.progress import warn
from gspure.public_model import PublicModel
from gspure.schemes.registry import find_scheme, recognized, require_own_files, schemes
from gspure.settings import DECIBELS, SEED, parsed_settings

EXAMPLES = """\
  gspure attack random_pruning --model point_cloud.ply --set fraction=0.25 --seed 1 --out random.ply
  gspure attack gspure --model point_cloud.ply --prune-mask prune_mask.npy --out purified.ply
  gspure attack plain_weight --model point_cloud.ply --weights weights.npy --set tau=4 --out plain.ply
  gspure attack rigid_transform --model point_cloud.ply --set angle=90 --out moved.ply --transform transform.npy
  gspure attack random_pruning --model point_cloud.ply --damage 1 --cameras cameras.json --out random_1dB.ply
  gspure attack finetune --model point_cloud.ply --cameras cameras.json --set iterations=20 --out finetuned.ply
"""

_EVIDENCE = {
    "--weights": "from `gspure weights`",
    "--prune-mask": "from `gspure prune`",
    "--opacities": "from `gspure opacities` (default: as stored in the model)",
    "--surface": "from `gspure surface`",
    "--labels": "clusters: labels.npy of `gspure purify`, or the .npz of `gspure cluster`",
}


def add_arguments(parser: Parser) -> None:
    names = ", ".join(described(attack.name, attack.settings) for attack in BUILT_IN)
    parser.text("name", "NAME", f"one of {names}, or an attack of an installed plug-in")
    parser.reads("--model", "MODEL", "file of the public model; the files beside it are copied")
    evidence = parser.add_argument_group("measurements, for attacks that need them")
    for option, origin in _EVIDENCE.items():
        evidence.add_argument(option, type=Path, metavar="FILE", help=origin)
    parser.number("--seed", "N", "random seed", SEED, 0)
    parser.pairs("--set", "NAME=VALUE", "a setting of the attack")
    parser.writes("--out", "PLY|SPZ", "the attacked model to write")
    parser.writes("--removed", "NPY", "also write the mask of the removed rows: bool [K]", required=False)
    add_scheme(parser)
    parser.writes(
        "--verdict",
        "JSON",
        "also write, for each extraction, whether the attack changed the columns that the extraction reads",
        required=False,
    )
    parser.writes(
        "--transform",
        "NPY",
        "also write the rigid transform of the model, over all attacks so far: float64 [4,4]",
        required=False,
    )
    meaning = "search for the strength that lowers the scene's PSNR by DB; needs --cameras"
    parser.number("--damage", "DB", meaning, DECIBELS)
    add_cameras(parser, "public views, for attacks that train and for --damage", required=False)
    parser.choice("--split", SPLITS, "views that --damage renders", "test")
    parser.reads(
        "--photographs",
        "DIR",
        "photographs VIEW.png of the scene, for --damage; without them, the damage is estimated as if "
        "MODEL had a PSNR of 30 dB in every view",
        required=False,
    )
    parser.writes(
        "--cost",
        "JSON",
        "also write CPU time (without the search of --damage) and peak memory (with it)",
        required=False,
    )
    parser.reads("--measured", "JSON", "for --cost: cost files of the measurements, to be added", nargs="*", default=[])
    add_device(parser)


def run(args: Arguments) -> None:
    """Write the attacked model and, on request, removed rows, verdict, transform and cost."""
    attack = find_attack(args.name)
    require_writable(args.out)
    settings: dict[str, Any] = parsed_settings(f"attack {attack.name}", attack.function, args.set)
    files = {name: getattr(args, name) for name in sorted(attack.needs) if getattr(args, name)}
    public, evidence = _read(args, files)
    public.require_place(args.out)
    if scheme := find_scheme(args.scheme) if args.scheme else recognized(public.model):
        require_own_files(scheme, args.out.parent, model_file(args.model), public.names(args.out))
    views = _read_training_views(args) if "cameras" in attack.parameters else []
    device = read_device(args) if views else None
    sources = {"model": model_file(args.model), **files} | ({"cameras": args.cameras} if args.cameras else {})
    known: dict[str, Any] = {"seed": args.seed, "cameras": views, "device": device}
    search = None
    begin = spent().cpu
    if args.damage is not None:
        search = attack.matching(public, evidence, args.damage, _read_damage(args, public), **known, **settings)
        settings[search.setting] = search.value
    searching = spent().cpu - begin
    attacked = attack.apply(public, evidence, **known, **settings)
    earlier = attacks_of(model_file(args.model))
    used = {"attack": attack.name, "after": earlier, "seed": args.seed, **attack.settings, **settings}
    if search:
        attacked = replace(attacked, model=attacked.model.with_comment(search.comment(args.damage)))
        reference = TRUTH if args.photographs else RENDER
        used |= {"damage": args.damage, "scene_drop": search.damage, "damage_reference": reference}
        _print_damage(args, search)
    kept, count = int((~attacked.prune_mask).sum()), attacked.count
    if not len(attacked.model):
        raise NotApplicable(attack.name, f"none of {count} rows would remain")
    written = public.with_model(attacked.model.with_background(public.model.background)).write(args.out)
    if args.removed:
        save_array(args.removed, attacked.prune_mask)
    motion = _motion(args.model, attacked)
    if args.transform:
        save_array(args.transform, UNMOVED if motion is None else motion)
    if args.verdict:
        strength = f"{attack.strength.setting}={used[attack.strength.setting]:.4g}" if attack.strength else ""
        strength += " " * bool(strength and earlier) + f"after {earlier}" * bool(earlier)
        missed = f", {search.damage:z.2f} dB reached" if search and search.misses(args.damage) else ""
        write_json(args.verdict, {"reached": _reached(args, public, attacked), "strength": strength + missed})
    for path in filter(None, (args.removed, args.transform, args.verdict)):
        kind = "removed rows" if path == args.removed else ""
        write_record(path, inputs=sources, settings=used, kind=kind)
    for path in written:
        write_record(path, inputs=sources, settings=used, motion=motion)
    _write_cost(args, searching, sources, used)
    print(f"{attack.name}: kept {kept} of {count} rows, {len(attacked.model)} in all")


def _motion(model: Path, attacked: Attacked) -> Float64 | None:
    """Return the rigid transform [4,4] from the cameras of the public model, over all attacks so far, if it is known.

    A model without a record counts as unmoved where an attack moves it.
    """
    earlier = motion_of(model_file(model))
    if earlier is None or attacked.transform is None:
        return attacked.transform if earlier is None else earlier
    return attacked.transform @ earlier


def _print_damage(args: Arguments, search: Match) -> None:
    """Print strength and damage, as a warning where the damage misses the target."""
    estimated = "" if args.photographs else "an estimated "
    drop = f"{search.setting}={search.value:.4g} lowers the scene's PSNR by {estimated}{search.damage:z.2f} dB"
    if search.misses(args.damage):
        warn(f"{args.name}: {drop}, not by {args.damage:g} dB")
    else:
        print(f"{args.name}: {drop}")


def _reached(args: Arguments, public: PublicModel, attacked: Attacked) -> dict[str, bool]:
    """Return for each extraction whether the attack changed its carrier; the scheme may be that of the record."""
    scheme = args.scheme or facts_of(model_file(args.model)).get("scheme")
    carriers = find_scheme(scheme).extractions if scheme in schemes() else {}
    return {name: reached(public.model, attacked, columns) for name, columns in carriers.items()}


def _write_cost(args: Arguments, searching: float, inputs: Mapping[str, Path], settings: Mapping[str, Any]) -> None:
    """Write the cost of the attack and its measurements without `searching` CPU seconds, unless one is unknown."""
    if args.cost and all(file.is_file() for file in args.measured):
        used = spent()
        total([used._replace(cpu=used.cpu - searching), *map(read_cost, args.measured)]).write(args.cost)
        write_record(args.cost, inputs=inputs, settings=settings)


def _read(args: Arguments, files: Mapping[str, Path]) -> tuple[PublicModel, Evidence]:
    """Read the public model, and the evidence in `files`."""
    public = read_public(args)
    evidence: dict[str, Any] = {"opacities": public.model.opacities} if public.rows_are_gaussians else {}
    types = {"weights": np.float32, "prune_mask": np.bool_, "opacities": np.float32, "surface": np.float32}
    for name, path in files.items():
        pruned_by = ["opacities"] if name == "weights" and "labels" in files else []
        require_kind(path, name, *pruned_by)
        if name == "labels":
            evidence[name] = read_labels(path)
        else:
            evidence[name] = load_array(path, dtype=types[name], shape=(len(public.model),), least=0)
    return public, Evidence(**evidence)


def _read_training_views(args: Arguments) -> list[Camera]:
    """Read the training views of ``--cameras``, for attacks that render."""
    if not args.cameras:
        raise InputError("attack", "--cameras", expected="public views to learn from", found="none")
    train, test = split(read_source(args.cameras, args.model, up=args.up))
    return train or test


def _read_damage(args: Arguments, public: PublicModel) -> Damage:
    """Return the function that measures the damage to the scene in the views of ``--cameras``."""
    if not args.cameras:
        raise InputError("attack", "--damage", expected="--cameras", found="none")
    views = read_split(args)
    photographs = None
    if args.photographs:
        is_moved = (motion := motion_of(model_file(args.model))) is not None and not np.allclose(motion, UNMOVED)
        numbers = {} if is_moved else {view.name: view.numbers.tolist() for view in views}
        require_photographs(args.photographs, SCENE, numbers)
        files = [args.photographs / f"{view.name}.png" for view in views]
        photographs = [read_image(file, background=public.model.background) for file in files]
        for file, image, view in zip(files, photographs, views, strict=True):
            if (found := image.shape[1::-1]) != (view.width, view.height):
                expected = f"{view.width}x{view.height}, as its view"
                raise InputError(file, "size", expected=expected, found="{}x{}".format(*found))
    return scene_damage(public, views, photographs, read_device(args))
