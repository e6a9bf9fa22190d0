"""Compressed models, written by gsply (MIT), an optional package."""

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from gspure.errors import InputError
from gspure.files import replacing
from gspure.model import header
from gspure.model.activations import CERTAIN, finite
from gspure.model.compressed import CHUNK
from gspure.model.finite import drawable
from gspure.model.gaussians import Gaussians
from gspure.model.spz import TURNED, TURNED_HARMONICS, TURNED_QUATS, with_comments
from gspure.progress import warn

PACKAGES: Final = {"gsply": "gspure[compression]"}
PACKED_PLY: Final = ".compressed.ply"
SPZ: Final = ".spz"

_FRACTION_BITS: Final = 12  # of positions in SPZ, as usual
_CHUNK_STEPS: Final = np.array([2047, 1023, 2047])  # of a coordinate in a chunk: 11, 10 and 11 bits
_FIXED_POINT: Final = (1 << 23) - 1  # the largest number of 24 bits


def is_plain(path: Path) -> bool:
    """Return whether a name is that of a ``.ply`` that is not compressed."""
    return path.suffix.lower() == ".ply" and not path.name.endswith(PACKED_PLY)


def write_compressed(path: Path, model: Gaussians) -> None:
    """Write a model with colours as compressed ``.ply`` or as SPZ 3, whole or not at all, as `writer` chooses.

    In a compressed ``.ply``, 256 successive rows share one range of values: sort them along a space-filling curve
    before. Values beyond the range of a format are clipped, and rows that are not finite become invisible, with a
    warning.
    """
    write = writer(path)
    if model.sh_degree < 0:
        raise InputError(path, "colour", expected="columns f_dc_*", found="features")
    with replacing(path) as temporary:
        write(temporary, drawable(model, path.name))


def writer(path: Path) -> Callable[[Path, Gaussians], None]:
    """Return the function that writes the format of a name; refuse other names, and a missing package gsply."""
    is_spz = path.suffix.lower() == SPZ
    if not (is_spz or path.name.endswith(PACKED_PLY)):
        raise InputError(path, "format", expected=f".ply, {PACKED_PLY} or {SPZ}", found=path.suffix or "no suffix")
    try:
        import gsply
    except ImportError as error:
        hint = f"pip install {PACKAGES['gsply']}"
        raise InputError(path, "gsply", expected="the package gsply", found=str(error), hint=hint) from None
    return partial(_write_spz if is_spz else _write_packed_ply, gsply)


def _write_packed_ply(gsply: Any, path: Path, model: Gaussians) -> None:
    _warn_of_clipping(model, f_rest_=(-4, 4), scale_=(-20, 20))
    size, starts = float(np.median(model.scales.max(axis=1))), np.arange(0, len(model), CHUNK)
    spans = np.maximum.reduceat(model.means, starts) - np.minimum.reduceat(model.means, starts)
    steps = (spans / _CHUNK_STEPS).max(axis=1)
    if rows := int(np.diff(np.append(starts, len(model)))[steps > size].sum()):
        larger = f"steps of up to {steps.max():.3g}, larger than the median Gaussian ({size:.3g})"
        warn(f"positions of {rows} of {len(model)} rows are rounded to {larger}: {CHUNK} consecutive rows share a box")
    data = gsply.compress_to_bytes(_parts(gsply, model, model.means, model.quats, model.sh_coeffs))
    path.write_bytes(header.with_comments(data, model.comments))


def _write_spz(gsply: Any, path: Path, model: Gaussians) -> None:
    _warn_of_clipping(model, f_dc_=(-10 / 3, 10 / 3), f_rest_=(-1, 1), scale_=(-10, 6))
    coeffs = model.sh_coeffs.copy()
    coeffs[:, 1:] *= TURNED_HARMONICS[: coeffs.shape[1] - 1]
    parts = _parts(gsply, model, model.means * TURNED, model.quats * TURNED_QUATS, coeffs)
    gsply.write_spz(path, parts, fractional_bits=_fraction_bits(path, model))
    path.write_bytes(with_comments(path.read_bytes(), header.encoded(model.comments)))


def _warn_of_clipping(model: Gaussians, **ranges: tuple[float, float]) -> None:
    """Warn of rows with values beyond the range of their column, named by its prefix."""
    for prefix, (least, largest) in ranges.items():
        values = model.columns(*model.columns_named(prefix))
        if rows := int(((values < least) | (values > largest)).any(axis=1).sum()):
            limits = f"{least:.3g} to {largest:.3g}"
            warn(f"{prefix}* of {rows} of {len(model)} rows are clipped to the range of the format, {limits}")


def _fraction_bits(path: Path, model: Gaussians) -> int:
    """Return as many fractional bits as leave room for the farthest centre; warn if positions become coarser."""
    distances = np.abs(model.means).max(axis=1)
    farthest, size = float(distances.max()), float(np.median(model.scales.max(axis=1)))
    bits = min(_FRACTION_BITS, math.floor(math.log2(_FIXED_POINT / max(farthest, 1))))
    if bits < 1 or 2.0**-bits > size:
        found = f"{2.0**-bits:.3g}, for coordinates up to {farthest:.3g}"
        hint = "`gspure info` lists far rows; remove them"
        raise InputError(path, "x, y, z", expected=f"steps of at most {size:.3g}", found=found, hint=hint)
    if bits < _FRACTION_BITS:
        far = int((distances > _FIXED_POINT / 2**_FRACTION_BITS).sum())
        text = f"{far} of {len(model)} rows have coordinates beyond ±2048"
        warn(f"{text}, so all positions are rounded to 1/{2**bits}, not to 1/4096")
    return bits


def _parts(gsply: Any, model: Gaussians, means: Any, quats: Any, coeffs: Any) -> Any:
    quats = quats / np.maximum(np.linalg.norm(quats, axis=1, keepdims=True), np.finfo(np.float32).tiny)
    opacities = np.clip(model.table["opacity"], -CERTAIN, CERTAIN)
    parts = means, finite(model.log_scales), quats, opacities, coeffs[:, 0], coeffs[:, 1:]
    return gsply.GSData.from_arrays(*parts, format="ply")
