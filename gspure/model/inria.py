"""The output folder of the INRIA trainer and its descendants.

::

    <model>/cfg_args                                      the trainer's arguments: "Namespace(k=v, ...)"
    <model>/cameras.json                                  every camera, test and train
    <model>/point_cloud/iteration_<N>/point_cloud.ply     the model after N iterations
"""

import ast
import re
from pathlib import Path
from typing import Final

from gspure.errors import InputError, reading

Argument = str | float | bool | int | None

POINT_CLOUD = "point_cloud.ply"
PURIFIED: Final = "purified.ply"  # in a folder that `gspure purify` wrote
UNPACKED_SOG = "meta.json"
STREAMED = "lod-meta.json"  # the index of a streamed model: one model per level of detail

_PARTS: Final = {UNPACKED_SOG: ("*.webp",), STREAMED: ("*.sog", f"*/{UNPACKED_SOG}", "*/*.webp")}
"""Patterns of the further files of a model, by the name of its index."""

_LEVEL: Final = re.compile(r"lod_?(\d+).*|(\d+)_\d+")  # names of chunks of a level of detail, such as 0_3 and lod0_3


def point_cloud(folder: Path) -> Path:
    """Return the model file of the newest iteration in an INRIA output folder, of `gspure purify`, or an unpacked SOG.

    A folder of SOG chunks without an index stands for itself.

    For an earlier iteration, pass its folder, ``<model>/point_cloud/iteration_7000``.
    """
    saved = saved_iterations(folder)
    if saved:
        return saved[max(saved)]
    for name in (POINT_CLOUD, PURIFIED, UNPACKED_SOG, STREAMED):
        if (folder / name).is_file():
            return folder / name
    models = sorted(file.name for suffix in ("ply", "sog", "splat", "spz") for file in folder.glob(f"*.{suffix}"))
    if len(sog_chunks(folder)) > 1 and all(name.endswith(".sog") for name in models):
        return folder
    expected = "an INRIA output folder with point_cloud/iteration_*/point_cloud.ply"
    problem = "no such folder"
    if folder.is_dir():
        problem = "no such file" if any(folder.iterdir()) else "an empty folder"
    models = sorted(file.name for suffix in ("ply", "sog", "splat", "spz") for file in folder.glob(f"*.{suffix}"))
    hint = f"name one of {', '.join(models)}" if models else "or name the .ply itself"
    raise InputError(folder, "point_cloud", expected=expected, found=problem, hint=hint)


def sog_chunks(folder: Path) -> list[Path]:
    """Return the SOG models in a folder, ``*.sog`` or ``*/meta.json``; of numbered levels of detail, the finest."""
    chunks = {file: file.stem for file in folder.glob("*.sog")}
    chunks |= {file: file.parent.name for file in folder.glob(f"*/{UNPACKED_SOG}")}
    matches = {file: _LEVEL.fullmatch(name) for file, name in chunks.items()}
    levels = {file: int(match[1] or match[2]) for file, match in matches.items() if match}
    finest = min(levels.values(), default=0)
    return sorted(file for file in chunks if levels.get(file, finest) == finest)


def model_parts(model: Path) -> list[Path]:
    """Return the files of a model: its file, and the images or chunks that this file names; or those of all chunks."""
    if model.is_dir():
        return [file for chunk in sog_chunks(model) for file in model_parts(chunk)]
    patterns = _PARTS.get(model.name, ())
    return [model, *sorted(file for pattern in patterns for file in model.parent.glob(pattern))]


def saved_iterations(folder: Path) -> dict[int, Path]:
    """Return the saved model files by iteration, in ascending order."""
    files = folder.glob(f"point_cloud/iteration_*/{POINT_CLOUD}")
    numbered = ((file.parent.name.removeprefix("iteration_"), file) for file in files)
    return dict(sorted((int(number), file) for number, file in numbered if number.isdecimal()))


def training_arguments(folder: Path) -> dict[str, Argument]:
    """Return the trainer's arguments from cfg_args; empty without that file.

    The trainer evaluates this Python expression; here it is only parsed. Strings, numbers, truth values and None are
    returned as such, all else, such as ``PosixPath('data')``, as source text.
    """
    file = Path(folder) / "cfg_args"
    if not file.is_file():
        return {}
    with reading(file, "Namespace(name=value, ...)"):
        call = ast.parse(file.read_text(encoding="utf-8").strip(), mode="eval").body
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "Namespace"):
            raise ValueError("another expression")
        arguments = {keyword.arg: _argument(keyword.value) for keyword in call.keywords if keyword.arg}
        str(arguments)  # raises ValueError for an integer with too many digits to print
        return arguments


def trained_background(source: Path) -> tuple[float, float, float]:
    """Return the background of training: white if cfg_args has ``white_background=True``, else black.

    `source` is the folder of cfg_args, a file in it, or the model of an iteration.
    """
    folder = source if source.is_dir() else source.parent
    if folder.match("point_cloud/iteration_*"):
        folder = folder.parents[1]
    white = training_arguments(folder).get("white_background", False)
    if white not in (False, True):  # 0 and 1 are equal to these
        raise InputError(folder / "cfg_args", "white_background", expected="True or False", found=repr(white))
    channel = float(white)
    return channel, channel, channel


def _argument(node: ast.expr) -> Argument:
    try:
        value = ast.literal_eval(node)
    except (ValueError, TypeError, RecursionError, MemoryError):
        value = ...
    return value if isinstance(value, Argument) else ast.unparse(node)
