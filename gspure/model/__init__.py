"""A set of 3D Gaussians and its files."""

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from gspure import files
from gspure.errors import InputError
from gspure.model.compressed import PACKED_PLY, package, read_splat, write_packed
from gspure.model.finite import drawable, require_finite
from gspure.model.gaussians import Gaussians
from gspure.model.inria import STREAMED, UNPACKED_SOG, point_cloud, trained_background
from gspure.model.ply import read_ply, write_ply
from gspure.model.sog import read_sog, read_streamed
from gspure.model.spz import read_spz, write_spz

__all__ = ["Gaussians", "model_file", "read_model", "require_finite", "require_writable", "write_model"]

_READERS = {".sog": read_sog, ".splat": read_splat, ".spz": read_spz, UNPACKED_SOG: read_sog, STREAMED: read_streamed}
"""By suffix, or by name; all others are PLY files, of which compressed ones are recognized by their header."""

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
    (rb'PK.*data\.pkl|\x80[\x02-\x05]|.{8}\{"', "a PyTorch checkpoint", _EXPORT, None),
    (rb"PK.*\.npy|\x93NUMPY|\x89HDF", "arrays", _EXPORT, None),
    (rb"PK|7z\xbc\xaf|Rar!|\xfd7zXZ|BZh\d|\x28\xb5\x2f\xfd|.{257}ustar", "an archive", _UNPACK, None),
    (rb"\x89PNG|\xff\xd8\xff|GIF8|RIFF....WEBP|BM....\x00{4}|II\*\x00|MM\x00\*", "a picture", _TRAIN, None),
    (rb"....ftyp", "a film or picture", _TRAIN, None),
    (rb"glTF|solid\s|Kaydara|PXR-USDC|(?:#[^\n]*\n|\s)*(mtllib|usemtl|[ogs]|v[nt]?)\s", "a mesh", _TRAIN, None),
    (rb"LASF|ASTM-E57|# \.PCD", "a point cloud", _TRAIN, None),
    (rb"(\xef\xbb\xbf)?\s*<", "a web page", _AGAIN, None),
    (rb"\s*[\[{]", "JSON", "name the model's file", ".json"),
    (rb"[^\x00-\x08\x0b\x0c\x0e-\x1f]+\Z", "text", _AGAIN, None),
)
"""Files of other kinds: pattern of the first bytes, what it is, a remedy, and the suffix of files that may begin so."""


def read_model(path: str | Path) -> Gaussians:
    """Read a model from a file, or from an INRIA output folder (its newest iteration).

    The file is a 3DGS or compressed ``.ply``, ``.splat``, ``.spz``, ``.sog``, or the ``meta.json`` or ``lod-meta.json``
    of an unpacked or streamed SOG model. Raise `InputError` if there is no such file, or if it holds no 3DGS model.
    """
    file = model_file(Path(path))
    if file.suffix.lower() == ".ksplat":
        hint = "convert it with splat-transform"
        raise InputError(file, "format", expected=".ply, .spz, .sog or .splat", found=file.name, hint=hint)
    read = _READERS.get(file.name) or _READERS.get(file.suffix.lower(), read_ply)
    try:
        model = read(file)
    except InputError as error:
        raise _recognized(file, error) from error
    return model.with_background(trained_background(file))


def _recognized(path: Path, error: InputError) -> InputError:
    """Return the error of reading a model; if the file is of another kind, one that names it and a remedy."""
    if not path.is_file():
        return error
    with path.open("rb") as stream:
        head = stream.read(512)
    kinds = (kind for kind in _KINDS if re.match(kind[0], head, re.DOTALL))
    _, what, hint, suffix = next(kinds, (b"", "", "", ""))
    if not what or suffix == path.suffix.lower():
        return error
    found = f"text, {head[:60].decode(errors='replace').strip()!r}" if what == "text" else what
    return InputError(path, "file", expected=error.expected, found=found, hint=hint)


def model_file(path: Path) -> Path:
    """Return the file of a model: the path itself, or in an INRIA output folder that of the newest iteration."""
    return point_cloud(path) if path.is_dir() else path


def write_model(path: str | Path, model: Gaussians) -> None:
    """Write a model as a binary little-endian 3DGS ``.ply``, whole or not at all.

    A name that ends with ``.compressed.ply`` or ``.spz`` selects that format. It rounds values and clips them to its
    range, and rows that are not finite become invisible, with a warning. In a compressed ``.ply``, 256 successive rows
    share one range of values: sort them along a space-filling curve before. Raise `InputError` for the name of a format
    that is only read.
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
    """Refuse a file to which `write_model` cannot write a model, before any work is done."""
    if not _is_plain(path):
        _writer(path)
    files.require_writable(path.parent)


def _is_plain(path: Path) -> bool:
    """Return whether a name is that of a ``.ply`` that is not compressed."""
    return path.suffix.lower() == ".ply" and not path.name.endswith(PACKED_PLY)


def _writer(path: Path) -> Callable[[Path, Gaussians], None]:
    """Return the function that writes the compressed format of a name; refuse other names, and a missing package."""
    is_spz = path.suffix.lower() == ".spz"
    if not (is_spz or path.name.endswith(PACKED_PLY)):
        raise InputError(path, "format", expected=f".ply, {PACKED_PLY} or .spz", found=path.suffix or "no suffix")
    return partial(write_spz if is_spz else write_packed, package(path, "gsply"))
