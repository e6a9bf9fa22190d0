"""A set of 3D Gaussians and its files."""

from pathlib import Path

from gspure import files
from gspure.errors import InputError
from gspure.model.compressed import read_splat
from gspure.model.compression import is_plain, write_compressed, writer
from gspure.model.finite import require_finite
from gspure.model.gaussians import Gaussians
from gspure.model.inria import STREAMED, UNPACKED_SOG, point_cloud, trained_background
from gspure.model.ply import read_ply, write_ply
from gspure.model.recognition import recognized
from gspure.model.sog import read_sog, read_streamed
from gspure.model.spz import read_spz

__all__ = ["Gaussians", "model_file", "read_model", "require_finite", "require_writable", "write_model"]

_READERS = {".sog": read_sog, ".splat": read_splat, ".spz": read_spz, UNPACKED_SOG: read_sog, STREAMED: read_streamed}
"""By suffix, or by name; all others are PLY files, of which compressed ones are recognized by their header."""


def read_model(path: str | Path) -> Gaussians:
    """Read a model from a file, or from an INRIA output folder (its newest iteration).

    The file is a 3DGS or compressed ``.ply``, ``.splat``, ``.spz``, ``.sog``, or the ``meta.json`` or ``lod-meta.json``
    of an unpacked or streamed SOG model. Raise `InputError` if there is no such file, or if it does not hold a 3DGS
    model.
    """
    file = model_file(Path(path))
    if file.suffix.lower() == ".ksplat":
        hint = "convert it with splat-transform"
        raise InputError(file, "format", expected=".ply, .spz, .sog or .splat", found=file.name, hint=hint)
    read = _READERS.get(file.name) or _READERS.get(file.suffix.lower(), read_ply)
    try:
        model = read(file)
    except InputError as error:
        raise recognized(file, error) from error
    return model.with_background(trained_background(file))


def model_file(path: Path) -> Path:
    """Return the file of a model: the path itself, or in an INRIA output folder that of the newest iteration."""
    return point_cloud(path) if path.is_dir() else path


def write_model(path: str | Path, model: Gaussians) -> None:
    """Write a model as a binary little-endian 3DGS ``.ply``, whole or not at all.

    A name that ends with ``.compressed.ply`` or ``.spz`` selects that format, which rounds all values. Raise
    `InputError` for the name of a format that is only read.
    """
    write = write_ply if is_plain(Path(path)) else write_compressed
    write(Path(path), model)


def require_writable(path: Path) -> None:
    """Refuse a file to which `write_model` cannot write a model, before any work is done."""
    if not is_plain(path):
        writer(path)
    files.require_writable(path.parent)
