"""What compressed formats have in common: colours, opacities and rotations in few bits."""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.artifacts.arrays import UNPACKED_RATIO, UNPACKED_ROOM
from gspure.constants import SH_DC
from gspure.errors import InputError
from gspure.files import Float32, Indices, UInt8
from gspure.model.activations import LEAST_OPACITY, logit

COEFFICIENTS: Final = (0, 3, 8, 15)  # spherical harmonics beyond the zeroth, by degree
_COLUMNS: Final = 17  # columns of a model without spherical harmonics beyond the zeroth

_OTHERS: Final = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])


def require_room(path: Path, size: int, rows: int, coefficients: int = 0) -> None:
    """Refuse a file without rows, and one whose `size` bytes would unpack to far more, before it is unpacked."""
    if rows < 1:
        raise InputError(path, "rows", expected="at least one", found=str(rows))
    unpacked, most = 4 * rows * (_COLUMNS + 3 * coefficients), max(UNPACKED_ROOM, UNPACKED_RATIO * size)
    if unpacked > most:
        raise InputError(path, "size", expected=f"at most {most} bytes unpacked", found=f"{unpacked} bytes")


def colour_coeffs(colours: NDArray[Any]) -> Float32:
    """Return the zeroth coefficients of colours, 0 to 1."""
    return np.asarray((colours - 0.5) / SH_DC, np.float32)


def byte_logits(opacities: UInt8) -> Float32:
    """Return the logits of opacities, 0 to 255."""
    return logit(opacities / 255, LEAST_OPACITY)


def positive_log(scales: NDArray[Any]) -> Float32:
    """Return the logarithms of scales: of the least normal float32 if they are 0, not-a-number if negative."""
    least = np.finfo(np.float32).tiny
    return np.log(np.where(scales < 0, np.nan, np.maximum(scales.astype(np.float32), least)), dtype=np.float32)


def smallest_three(three: NDArray[Any], largest: Indices) -> Float32:
    """Return unit quaternions [K,4] from their three smallest components [K,3] and the index [K] of the largest."""
    quats = np.empty((len(three), 4), np.float32)
    np.put_along_axis(quats, _OTHERS[largest], three, 1)
    rest = np.sqrt(np.maximum(0, 1 - np.sum(np.square(three), 1, keepdims=True)))
    np.put_along_axis(quats, largest[:, None], rest, 1)
    return quats
