"""``gspure attack``: one variant of a model."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from gspure.arrays import save_array
from gspure.attacks import BUILT_IN, find_attack
from gspure.attacks.reference import NOTES, reference
from gspure.attacks.strength import Damage, Match, scene_damage
from gspure.cameras import Camera
from gspure.cameras.photographs import missing_photographs
from gspure.cameras.splits import views_of_split
from gspure.cli import options
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError
from gspure.evaluation.attacking import AttackResult, Context, attacked, learns
from gspure.evaluation.plan import AttackSpec
from gspure.files import alone_in
from gspure.images import read_image
from gspure.model import model_file, require_writable
from gspure.opencl.device import Device
from gspure.progress import warn
from gspure.provenance import bind_rows, require_rows_of
from gspure.public_model import PublicModel
from gspure.schemes.registry import read_public_model
from gspure.settings import DECIBELS, SEED, parsed_settings
from gspure.training.dataset import read_photographs

EXAMPLES = """\
  gspure attack random_pruning --model point_cloud.ply --set fraction=0.25 --seed 1 --out random/point_cloud.ply
  gspure attack plain_weight --model point_cloud.ply --weights purified/weights.npy --out plain/point_cloud.ply
  gspure attack random_pruning --model point_cloud.ply --damage 1 --cameras cameras.json --out random_1dB.ply

`gspure attack NAME --help` tells what an attack does, its settings, strength and source.
"""

_MEASUREMENTS = {
    "weights": "weights.npy of `gspure purify` or of the workflow",
    "prune_mask": "prune_mask.npy of `gspure purify` or of the workflow",
    "opacities": "opacities.npy of the workflow (default: as stored in the model)",
    "surface": "surface.npy of the workflow",
    "labels": "labels.npy of `gspure purify`, or clusters.npz of the workflow",
}


def add_arguments(parser: Parser) -> None:
    parser.described = _described
    parser.text("name", "NAME", "one of the attacks below, or of a plug-in; those on renders need a configuration")
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
    meaning = "search for the strength that lowers the scene's PSNR by DB; needs --cameras and photographs of the scene"
    parser.number("--damage", "DB", meaning, DECIBELS)
    options.add_cameras(parser, "public views, for attacks that train and for --damage", required=False)
    parser.choice("--split", options.SPLITS, "views that --damage renders", "test")
    meaning = "photographs VIEW.png of the scene, for --damage (default: those that the cameras name)"
    parser.reads("--photographs", "DIR", meaning, required=False)
    options.add_device(parser)


def _described(name: str) -> str:
    """Return what an attack does, also of one on renders or of a plug-in."""
    return f"{name}\n\n{reference(find_attack(name))}\n{NOTES}"


@dataclass(frozen=True)
class AttackOptions:
    """The arguments of the command."""

    name: str
    model: Path
    out: Path
    seed: int
    set: Sequence[tuple[str, str]]
    weights: Path | None
    prune_mask: Path | None
    opacities: Path | None
    surface: Path | None
    labels: Path | None
    removed: Path | None
    transform: Path | None
    scheme: str | None
    damage: float | None
    cameras: Path | str | None
    up: Sequence[float] | None
    split: str
    photographs: Path | None
    device: str | None


def run(args: Arguments) -> None:
    """Write the attacked model and, on request, removed rows and transform; refuse folders that others write."""
    wanted = options.typed(args, AttackOptions)
    require_writable(wanted.out)
    spec = _spec(wanted)
    model = model_file(wanted.model)
    files = (wanted.out, wanted.removed, wanted.transform)
    folders = {file.parent.resolve(): file.parent for file in files if file}
    with ExitStack() as stack:
        for folder in folders.values():
            stack.enter_context(alone_in(folder))
        public = read_public_model(wanted.model, wanted.scheme).drawable(wanted.model)
        for file in spec.measured.values():
            require_rows_of(model, file)
        attack_result = attacked(public, spec, _context(wanted, spec))
        if attack_result.match and wanted.damage is not None:
            _mention(attack_result, attack_result.match, wanted.damage)
        attack_result.public.write(wanted.out)
        if wanted.removed:
            save_array(wanted.removed, attack_result.attacked.prune_mask)
            bind_rows(model, wanted.removed)
        if wanted.transform:
            save_array(wanted.transform, attack_result.transform)
        options.record_command(args, wanted.out.parent, resolved={"set": attack_result.settings})
        print(attack_result.sentence)


def _spec(wanted: AttackOptions) -> AttackSpec:
    """Return the attack that the arguments name, or raise `InputError` for a setting that it does not take."""
    attack = find_attack(wanted.name)
    if attack.of_renders:
        hint = "variants of the workflow apply it"
        source = f"attack {attack.name}"
        raise InputError(source, "name", expected="an attack on models", found="one on renders", hint=hint)
    settings = parsed_settings(f"attack {attack.name}", attack.function, dict(wanted.set))
    files: dict[str, Path | None] = {
        name: getattr(wanted, name) for name in sorted(attack.needs & _MEASUREMENTS.keys())
    }
    measured = {name: file for name, file in files.items() if file}
    return AttackSpec(attack.name, settings=settings, seed=wanted.seed, damage=wanted.damage, measured=measured)


def _context(wanted: AttackOptions, spec: AttackSpec) -> Context:
    """Return the views and the device of attacks that train and of ``--damage``; nothing for others."""
    trains = learns(find_attack(spec.name))
    searches = spec.damage is not None
    if not trains and not searches:
        return Context()
    if not wanted.cameras:
        raise InputError("attack", "--cameras", expected="public views, which the attack renders", found="none")
    device = options.selected_device(wanted.device)
    cameras = options.read_source(wanted.cameras, wanted.model, up=wanted.up)
    views = views_of_split(cameras, "train", wanted.cameras) if trains else []
    rendered = views_of_split(cameras, wanted.split, wanted.cameras) if searches else []
    return Context(views, device, partial(_damage, rendered, wanted.photographs, device))


def _damage(views: Sequence[Camera], folder: Path | None, device: Device, public: PublicModel) -> Damage:
    """Return the function that measures the damage to the scene in some views, against photographs in a folder."""
    background = public.model.background
    if folder:
        photographs = [read_image(folder / f"{v.name}.png", (v.width, v.height), background) for v in views]
    elif missing_photographs(views):
        hint = "damage is a drop of the PSNR against them"
        raise InputError("attack", "--photographs", expected="photographs of the views", found="none", hint=hint)
    else:
        photographs = read_photographs(views, background)
    return scene_damage(public, views, photographs, device)


def _mention(attack_result: AttackResult, match: Match, wanted: float) -> None:
    """Print the strength at which a search ended; warn if it misses the damage."""
    drop = f"{match.damage:z.2f} dB"
    sentence = f"{attack_result.attack.name}: {attack_result.strength} lowers the scene's PSNR by {drop}"
    if match.misses(wanted):
        warn(f"{sentence}, not by {wanted:g} dB")
    else:
        print(sentence)
