"""A set of 3D Gaussians and its files."""

from pathlib import Path

from gspure.artifacts import require_place
from gspure.model.compressed import is_compressed, read_compressed
from gspure.model.compressed.writing import PACKED_PLY, write_compressed, writer
from gspure.model.finite import require_finite
from gspure.model.gaussians import Gaussians
from gspure.model.inria import point_cloud, trained_background
from gspure.model.ply import read_ply, write_ply

__all__ = ["Gaussians", "model_file", "read_model", "require_finite", "require_writable", "write_model"]


def read_model(path: str | Path) -> Gaussians:
    """Read a model from a file, or from an INRIA output folder (its newest iteration).

    The file is a 3DGS or compressed ``.ply``, ``.splat``, ``.ksplat``, ``.spz``, ``.sog``, or the ``meta.json`` of an
    unpacked SOG model. Raise `InputError` if there is no such file, or if it does not hold a 3DGS model.
    """
    file = model_file(Path(path))
    model = read_compressed(file) if is_compressed(file) else read_ply(file)
    model.require_background(file)
    return model.with_background(trained_background(file))


def model_file(path: Path) -> Path:
    """Return the file of a model: the path itself, or in an INRIA output folder that of the newest iteration."""
    return point_cloud(path) if path.is_dir() else path


def write_model(path: str | Path, model: Gaussians) -> None:
    """Write a model as a binary little-endian 3DGS ``.ply``, whole or not at all.

    A name that ends with ``.compressed.ply`` or ``.spz`` selects that format, which rounds all values. Raise
    `InputError` for the name of a format that is only read.
    """
    path = Path(path)
    if _is_plain(path):
        write_ply(path, model)
    else:
        write_compressed(path, model)


def require_writable(path: Path) -> None:
    """Refuse a file to which `write_model` cannot write a model, before any work is done."""
    if not _is_plain(path):
        writer(path)
    require_place(path)


def _is_plain(path: Path) -> bool:
    return path.suffix.lower() == ".ply" and not path.name.endswith(PACKED_PLY)
