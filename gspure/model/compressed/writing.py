"""Compressed models, written by gsply (MIT), an optional package."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from gspure.artifacts import replacing
from gspure.errors import InputError
from gspure.model.compressed.spz import TURNED, TURNED_HARMONICS, TURNED_QUATS, with_comments
from gspure.model.gaussians import Gaussians

PACKAGES: Final = {"gsply": "gspure[compression]"}
PACKED_PLY: Final = ".compressed.ply"
SPZ: Final = ".spz"


def write_compressed(path: Path, model: Gaussians) -> None:
    """Write a model with colours as compressed ``.ply`` or as SPZ 3, whole or not at all.

    In a compressed ``.ply``, 256 successive rows share one range of values: sort them along a space-filling curve
    before.

    Raise `InputError` if the name is that of another format, the model has no colours, or gsply is not installed.
    """
    write = _WRITERS.get(PACKED_PLY if path.name.endswith(PACKED_PLY) else path.suffix.lower())
    if write is None:
        raise InputError(path, "format", expected=f".ply, {PACKED_PLY} or {SPZ}", found=path.suffix)
    if model.sh_degree < 0:
        raise InputError(path, "colour", expected="columns f_dc_*", found="features")
    try:
        import gsply
    except ImportError as error:
        hint = f"pip install {PACKAGES['gsply']}"
        raise InputError(path, "gsply", expected="the package gsply", found=str(error), hint=hint) from None
    with replacing(path) as temporary:
        write(gsply, temporary, model)


def _write_packed_ply(gsply: Any, path: Path, model: Gaussians) -> None:
    data = gsply.compress_to_bytes(_parts(gsply, model.means, model.quats, model.sh_coeffs, model))
    magic, encoding, rest = data.split(b"\n", 2)
    path.write_bytes(b"\n".join([magic, encoding, *(b"comment " + line for line in _comments(model)), rest]))


def _write_spz(gsply: Any, path: Path, model: Gaussians) -> None:
    coeffs = model.sh_coeffs.copy()
    coeffs[:, 1:] *= TURNED_HARMONICS[: coeffs.shape[1] - 1]
    gsply.write_spz(path, _parts(gsply, model.means * TURNED, model.quats * TURNED_QUATS, coeffs, model))
    path.write_bytes(with_comments(path.read_bytes(), _comments(model)))


def _comments(model: Gaussians) -> list[bytes]:
    return [line.encode("ascii", "replace") for comment in model.comments for line in comment.splitlines()]


def _parts(gsply: Any, means: Any, quats: Any, coeffs: Any, model: Gaussians) -> Any:
    norms = np.linalg.norm(quats, axis=1, keepdims=True)
    return gsply.GSData.from_arrays(
        means,
        model.columns("scale_0", "scale_1", "scale_2"),
        quats / np.maximum(norms, np.finfo(np.float32).tiny),
        model.table["opacity"].copy(),
        coeffs[:, 0],
        coeffs[:, 1:],
        format="ply",
    )


_WRITERS: Final[dict[str, Callable[[Any, Path, Gaussians], None]]] = {PACKED_PLY: _write_packed_ply, SPZ: _write_spz}
