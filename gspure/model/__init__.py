"""A set of 3D Gaussians and its files."""

from __future__ import annotations

from pathlib import Path

from gspure.model.finite import require_finite
from gspure.model.gaussians import Gaussians
from gspure.model.inria import point_cloud, trained_background
from gspure.model.ply import read_ply, write_ply

__all__ = ["Gaussians", "model_file", "read_model", "require_finite", "write_model"]


def read_model(path: str | Path) -> Gaussians:
    """Read a model from a 3DGS ``.ply``, or from an INRIA output folder (its newest iteration).

    Raise `InputError` if there is no such file, or if it does not hold a 3DGS model.
    """
    file = model_file(Path(path))
    return read_ply(file).with_background(trained_background(file))


def model_file(path: Path) -> Path:
    """Return the ``.ply`` of a model: the file itself, or that of an INRIA output folder's newest iteration."""
    return point_cloud(path) if path.is_dir() else path


def write_model(path: str | Path, model: Gaussians) -> None:
    """Write a model as a binary little-endian 3DGS ``.ply``, whole or not at all."""
    write_ply(Path(path), model)
