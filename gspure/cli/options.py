"""Options and arguments that several commands share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from gspure.cli.parser import Arguments, Parser, filled
from gspure.errors import InputError
from gspure.settings import COORDINATE, SEED, SHARE

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    from gspure.attacks import Attack
    from gspure.cameras import Camera
    from gspure.opencl.device import Device
    from gspure.plugins import Part
    from gspure.schemes.scheme import Key, Scheme

Options = TypeVar("Options", bound="DataclassInstance")

SPLITS = ("train", "test", "all")


QUIET = ("-q", "--quiet", "print no progress, only results and warnings")
FORCE = ("--force", "write to a folder that holds other files")  # for `require_own_folder` and `require_empty_folder`
PER_VIEW = ("--per-view", "print the metrics of every view, not only their mean and the worst")
SCHEME = ("--scheme", "NAME", "the model's watermarking scheme (default: recognized from the model's columns)")


def add_device(parser: Parser) -> None:
    """Add ``--device``, and ``--quiet``, since work on a device shows its progress."""
    parser.flag(*QUIET)
    meaning = "part of the OpenCL device's name, or index in `gspure doctor` (default: $GSPURE_DEVICE or the first)"
    parser.text("--device", "NAME|INDEX", meaning)


def typed(args: Arguments, kind: type[Options]) -> Options:
    """Return the arguments of a command as its dataclass."""
    return kind(**{field.name: getattr(args, field.name) for field in fields(kind)})


def read_device(args: Arguments) -> Device:
    """Return the device that ``--device`` selects; log its name."""
    return selected_device(args.device)


def selected_device(name: str | None) -> Device:
    """Return the device of a name or index as ``--device`` takes it; log its full name."""
    from gspure.opencl.device import choose_device
    from gspure.progress import say

    device = choose_device(name)
    say(f"device {device}")
    return device


def key_scheme(args: Arguments) -> str:
    """Return the name of the scheme: that of ``--scheme``, by default that of ``--key``."""
    from gspure.schemes.registry import made_by

    name: str = args.scheme or made_by(args.key)[0]
    return name


def read_key(args: Arguments, run: str) -> Key:
    """Return the key of `key_scheme` in ``--key``, or the unrelated one of ``--wrong-key``.

    Unless ``--control`` is set, refuse the key of another embedding than `run`, the run ID of the model.
    """
    import numpy as np

    from gspure.provenance import run_of
    from gspure.schemes.registry import find_scheme

    key = find_scheme(key_scheme(args)).read_key(args.key)
    if args.wrong_key is not None:
        return key.wrong(np.random.default_rng(args.wrong_key))
    key_run = run_of(args.key)
    if run and key_run and run != key_run and not args.control:
        hint = "--control accepts the key of another model, a negative control"
        raise InputError(args.key, "run", expected=f"{run}, as of the model", found=key_run, hint=hint)
    return key


def add_control_keys(parser: Parser) -> None:
    """Add ``--wrong-key`` and ``--control``, for `read_key`."""
    parser.number("--wrong-key", "SEED", "use an unrelated key, drawn with this seed: a negative control", SEED)
    parser.flag("--control", "accept the key of another model: a negative control")


def add_background(parser: Parser, behind: str, known: str) -> None:
    """Add ``--background``, the colour `behind` the model; `known` is the argument that may name the default."""
    meaning = f"colour behind {behind} (default: the background of {known}'s training, else black)"
    parser.number("--background", ("R", "G", "B"), meaning, SHARE, nargs=3)


def add_energy(parser: Parser, *energies: str) -> None:
    """Add ``--energy``; the first one is the default."""
    described = {
        "ewa": "2-D splats, as in vanilla 3DGS",
        "ray": "the maximum along the pixel's ray, the paper's equation",
        "center_ray": "as ray, but only on the ray through the Gaussian's centre",
    }
    meanings = "; ".join(f"{energy}: {described[energy]}" for energy in energies)
    parser.choice("--energy", energies, f"value of a Gaussian at a pixel; {meanings}", energies[0])


def camera_source(text: str) -> Path | str:
    """Return a path, or the name of a way to generate views; an argument type."""
    from gspure.cameras import GENERATED

    return text if text in GENERATED else filled(Path, text)


def add_cameras(parser: Parser, purpose: str = "views", *, more: str = "", required: bool = True) -> None:
    """Add ``--cameras`` and ``--up``, for `read_source`; `more` follows the description."""
    meaning = f"{purpose}: a file or folder that `gspure cameras` reads, or `orbit` or `shells` to generate them{more}"
    parser.reads("--cameras", "SOURCE", meaning, type=camera_source, required=required)
    add_up(parser)


def add_up(parser: Parser, **group: Any) -> None:
    """Add ``--up``, a setting of generated views."""
    meaning = "up direction of generated views, such as 0 0 1 (default: guessed from the model's shape)"
    parser.number("--up", ("X", "Y", "Z"), meaning, COORDINATE, nargs=3, **group)


def read_source(source: Path | str, model: Path | None, *, shows_model: bool = True, **settings: Any) -> list[Camera]:
    """Read cameras, in the world of the model, or generate them; `settings` that are not None are for generating.

    Unless `shows_model` is set, the views show something else, such as a message, and are moved by an offset only.
    """
    from gspure.cameras import GENERATED, read_cameras
    from gspure.cameras.worlds import around_offset, in_world_of
    from gspure.model import read_model

    settings = {name: value for name, value in settings.items() if value is not None}
    if isinstance(source, Path):
        if settings:
            conflict = f"a camera file and --{next(iter(settings))}"
            raise InputError(source, "source", expected="orbit or shells", found=conflict)
        cameras = read_cameras(source)
        if model is None:
            return cameras
        return in_world_of(model, cameras, source) if shows_model else around_offset(model, cameras, source)
    if model is None:
        raise InputError(source, "--model", expected="the model to look at", found="nothing")
    return GENERATED[source](read_model(model), **settings)


def add_views(parser: Parser, split: str, **cameras: Any) -> None:
    """Add ``--cameras``, ``--split`` and ``--transform``, for `read_views`."""
    add_cameras(parser, **cameras)
    parser.choice("--split", SPLITS, "which views; sorted by name, every eighth is a test view", split)
    meaning = "rigid transform from `gspure attack --transform`, applied to the views"
    parser.reads("--transform", "NPY", meaning, required=False)


def read_views(
    args: Arguments, split: str, transform: Path | None = None, source: Path | str | None = None
) -> list[Camera]:
    """Read the views of a split of ``--cameras``, or of a message's `source`, moved by a rigid transform."""
    from gspure.cameras.reading import read_transform
    from gspure.cameras.splits import views_of_split

    shows_model = source is None and transform is None
    source = source or args.cameras
    cameras = read_source(source, args.model, shows_model=shows_model, up=args.up)
    views = views_of_split(cameras, split, source)
    if transform is None:
        return views
    motion = read_transform(transform)
    return [view.moved(motion) for view in views]


def write_views(folder: Path, views: Sequence[Camera]) -> None:
    """Write ``cameras.json`` without photographs to a folder."""
    from gspure.cameras import write_cameras

    write_cameras(folder / "cameras.json", [replace(view, image=None) for view in views])


def record_command(args: Arguments, folder: Path, run: str = "", resolved: Mapping[str, object] | None = None) -> None:
    """Write ``provenance.json`` to a folder of results: arguments that are paths are inputs, others are settings.

    `run` is the run ID if the inputs have none (`gspure.provenance.write_provenance`). `resolved` replaces arguments by
    the values that the command used, such as defaults that depend on the model.
    """
    from gspure.model import model_file
    from gspure.provenance import write_provenance

    skipped = {*args.outputs, "outputs", "run", "verb", "quiet", "force"}
    values = vars(args) | dict(resolved or {})
    recorded = {name: value for name, value in values.items() if name not in skipped}
    inputs = {name: value for name, value in recorded.items() if isinstance(value, Path)}
    settings = {name: value for name, value in recorded.items() if name not in inputs}
    if "model" in inputs:
        inputs["model"] = model_file(inputs["model"])
    further = [values[name] for name in args.outputs if name != "out" and values[name]]
    write_provenance(folder, args.verb, inputs=inputs, settings=settings, further=further, run=run)


def require_own_folder(args: Arguments) -> None:
    """Refuse an output folder with files that this command did not write, unless ``--force`` is set."""
    from gspure.files import read_json
    from gspure.provenance import PROVENANCE

    provenance = args.out / PROVENANCE
    record = read_json(provenance) if provenance.is_file() and not args.force else None
    if not (isinstance(record, dict) and record.get("command") == args.verb):
        require_empty_folder(args, f"an empty folder or results of `gspure {args.verb}`", "other files")


def require_empty_folder(args: Arguments, expected: str = "an empty folder", found: str = "files") -> None:
    """Refuse an output folder with files, unless ``--force`` is set."""
    visible = args.out.glob("[!.]*")
    has_files = any(file.is_file() for path in visible for file in (path, *path.rglob("*")))
    if has_files and not args.force:
        hint = "name another folder, or use --force"
        raise InputError(args.out, "--out", expected=expected, found=found, hint=hint)


def remove_older(folder: Path, *patterns: str) -> None:
    """Remove files of an earlier run, which the next run may not replace."""
    for pattern in patterns:
        for path in folder.glob(pattern):
            if path.is_file():
                path.unlink()


def list_choices(parser: Parser, part: Part, choices: Iterable[Attack | Scheme]) -> None:
    """Add a list of attacks or schemes below the examples, with their settings and defaults; then those of packages."""
    from gspure.plugins import added_by, installed, package_of

    lines = [f"{parser.epilog}", f"{part}, with the defaults of their settings:", *map(_choice_line, choices)]
    for entry in installed():
        added = added_by(entry, part)
        if added:
            lines += [f"{part} of {package_of(entry)}:", *map(_choice_line, added)]
    parser.epilog = "\n".join(lines)


def _choice_line(choice: Attack | Scheme) -> str:
    """Return the name of an attack or a scheme, its settings with defaults, and the packages that it needs."""
    settings = [f"{name}={value}" for name, value in choice.settings.items()]
    needs = [f"(pip install '{requirement}')" for requirement in choice.packages.values()]
    return f"  {choice.name:<28}{' '.join([*settings, *needs])}".rstrip()
