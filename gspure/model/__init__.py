"""A set of 3D Gaussians and its files."""

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from gspure import files
from gspure.errors import InputError
from gspure.model.compressed import PACKED_PLY, package, read_splat, write_packed
from gspure.model.copies import read_copy
from gspure.model.finite import drawable, require_finite
from gspure.model.gaussians import Gaussians
from gspure.model.inria import (
    POINT_CLOUD,
    STREAMED,
    UNPACKED_SOG,
    point_cloud,
    saved_iterations,
    trained_background,
)
from gspure.model.ply import read_ply, write_ply
from gspure.model.sog import read_chunks, read_sog, read_streamed
from gspure.model.spz import read_spz, write_spz

__all__ = [
    "Gaussians",
    "is_trained_model",
    "model_file",
    "read_model",
    "require_finite",
    "require_writable",
    "write_model",
]

_READERS: Final[dict[str, Callable[[Path], Gaussians]]] = {
    ".sog": read_sog,
    ".splat": read_splat,
    ".spz": read_spz,
    UNPACKED_SOG: read_sog,
    STREAMED: read_streamed,
}
"""Readers by suffix or by name. All other files are PLY; the header of a compressed one tells that it is."""

_SAVE: Final = "save it as .ply, .spz or .sog in the program that made it"
_CONVERT: Final = "convert it with splat-transform"
_FORMATS: Final = {
    ".ksplat": ("GaussianSplats3D", _CONVERT),
    ".lcc": ("XGRIDS", _CONVERT),
    ".psht": ("Postshot", _SAVE),
    ".rad": ("Spark", _SAVE),
    ".spx": ("Reall3D", _SAVE),
    ".ssproj": ("SuperSplat", _SAVE),
}
"""Formats of models that are not read, by suffix: their program, and a remedy."""

_UNPACK: Final = "unpack it, and name the model's file"
_EXPORT: Final = "export a .ply with the trainer, as by `ns-export gaussian-splat`"
_TRAIN: Final = "`gspure train` makes a model from photographs"
_AGAIN: Final = "download the file itself, on a web page its raw version"

_KINDS: Final = (
    (rb"\Z", "an empty file", "copy or download it again", None),
    (rb"version https://git-lfs", "a Git LFS pointer", "run `git lfs pull`", None),
    (rb"\S*annex/objects/", "a git-annex pointer", "run `git annex get`", None),
    (rb"\x1f\x8b", "a gzip archive", f"{_UNPACK}; one of SPZ is named .spz", ".spz"),
    (rb"NGSP", "an SPZ model", "name it .spz", ".spz"),
    (rb"PK.*(meta\.json|\.webp)", "a SOG model", "name it .sog", ".sog"),
    (rb"\s*ply\s", "a PLY", "name it .ply", ".ply"),
    (rb"(glTF|\s*\{).*KHR_gaussian_splatting", "Gaussians in glTF", _SAVE, None),
    (rb"PK.*\.usd|PXR-USDC|#usda", "a USD scene", _SAVE, None),
    (rb"PK.*data\.pkl|\x80[\x02-\x05]|.{5}\x00{3}\{", "a PyTorch checkpoint", _EXPORT, None),
    (rb"PK.*\.npy|\x93NUMPY|\x89HDF", "arrays", _EXPORT, None),
    (rb"PK|7z\xbc\xaf|Rar!|\xfd7zXZ|BZh\d|\x28\xb5\x2f\xfd|.{257}ustar", "an archive", _UNPACK, None),
    (rb"\x89PNG|\xff\xd8\xff|GIF8|RIFF....WEBP|BM....\x00{4}|II\*\x00|MM\x00\*", "a picture", _TRAIN, None),
    (rb"....ftyp", "a film or picture", _TRAIN, None),
    (rb"glTF|solid\s|Kaydara|(?:#[^\n]*\n|\s)*(mtllib|usemtl|[ogs]|v[nt]?)\s", "a mesh", _TRAIN, None),
    (rb"LASF|ASTM-E57|# \.PCD", "a point cloud", _TRAIN, None),
    (rb"(\xef\xbb\xbf)?\s*<", "a web page", _AGAIN, None),
    (rb"\s*[\[{]", "JSON", "name the model's file", ".json"),
    (rb"[^\x00-\x08\x0b\x0c\x0e-\x1f]+\Z", "text", _AGAIN, None),
)
"""Files of other kinds: pattern of the first bytes, kind, remedy, and the suffix of models that begin in this way."""


def read_model(path: str | Path) -> Gaussians:
    """Read a model from a file, or from an INRIA output folder (its newest iteration).

    The file is a 3DGS or compressed ``.ply``, ``.splat``, ``.spz``, ``.sog``, or the ``meta.json`` or ``lod-meta.json``
    of an unpacked or streamed SOG model; a folder of several SOG models is one model in chunks. Raise `InputError` if
    there is no such file, or if it holds no 3DGS model.

    >>> model = gspure.read_model("model.ply")
    >>> len(model), model.means.shape, model.sh_degree
    (400, (400, 3), 1)
    """
    file = model_file(Path(path))
    if file.suffix.lower() in _FORMATS:
        program, hint = _FORMATS[file.suffix.lower()]
        found = f"{file.name} of {program}"
        raise InputError(file, "format", expected=".ply, .spz, .sog or .splat", found=found, hint=hint)
    try:
        reader = _reader(file)
        model = read_ply(file) if reader is read_ply else read_copy(file, reader)
    except InputError as error:
        raise _recognized(file, error) from error
    return model.with_background(trained_background(file))


def _reader(file: Path) -> Callable[[Path], Gaussians]:
    """Return the reader of a file, by its name or suffix, or that of a folder of chunks."""
    if file.is_dir():
        return read_chunks
    return _READERS.get(file.name) or _READERS.get(file.suffix.lower(), read_ply)


def _recognized(path: Path, error: InputError) -> InputError:
    """Return an error that names the kind of the file and a remedy; for a file of no known kind, the error itself."""
    if not path.is_file():
        return error
    with path.open("rb") as stream:
        head = stream.read(1 << 16)
    matching = (row for row in _KINDS if re.match(row[0], head, re.DOTALL))
    _, kind, hint, suffix = next(matching, (b"", "", "", ""))
    if not kind or suffix == path.suffix.lower():
        return error
    if kind == "text":
        kind = f"text, {head[:60].decode(errors='replace').strip()!r}"
    return InputError(path, "file", expected=error.expected, found=kind, hint=hint)


def model_file(path: Path) -> Path:
    """Return the file of a model: the path itself, or in an INRIA output folder that of the newest iteration.

    The chunks of a SOG model have only their folder.
    """
    return point_cloud(path) if path.is_dir() else path


def is_trained_model(source: str) -> bool:
    """Return whether a path is a trained model, a ``.ply`` or a folder with one, rather than photographs."""
    path = Path(source)
    return path.suffix == ".ply" or bool(saved_iterations(path)) or (path / POINT_CLOUD).is_file()


def write_model(path: str | Path, model: Gaussians) -> None:
    """Write a model as a binary little-endian 3DGS ``.ply``, whole or not at all.

    The suffix ``.compressed.ply`` or ``.spz`` selects that format, which rounds values and clips them to its range;
    rows that are not finite become invisible, with a warning. In a compressed ``.ply``, 256 successive rows share one
    range of values: sort them along a space-filling curve before. Raise `InputError` for a format that can only be
    read.

    >>> gspure.write_model("half.ply", model[:200])
    >>> len(gspure.read_model("half.ply"))
    200
    """
    path = Path(path)
    if _is_plain(path):
        write_ply(path, model)
        return
    write = _writer(path)
    if model.sh_degree < 0:
        raise InputError(path, "colour", expected="columns f_dc_*", found="features")
    with files.replacing(path) as temporary:
        write(temporary, drawable(model, path.name))


def require_writable(path: Path) -> None:
    """Refuse a path to which `write_model` cannot write, before any work is done."""
    if not _is_plain(path):
        _writer(path)
    files.require_writable(path.parent)


def _is_plain(path: Path) -> bool:
    """Return whether the suffix is that of an uncompressed ``.ply``."""
    return path.suffix.lower() == ".ply" and not path.name.endswith(PACKED_PLY)


def _writer(path: Path) -> Callable[[Path, Gaussians], None]:
    """Return the writer of a compressed format, selected by suffix; refuse other suffixes, and a missing package."""
    is_spz = path.suffix.lower() == ".spz"
    if not (is_spz or path.name.endswith(PACKED_PLY)):
        raise InputError(path, "format", expected=f".ply, {PACKED_PLY} or .spz", found=path.suffix or "no suffix")
    return partial(write_spz if is_spz else write_packed, package(path, "gsply"))
