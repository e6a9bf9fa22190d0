"""Rigid transforms: what counts as one."""

from pathlib import Path
from typing import Final

import numpy as np

from gspure.dtypes import Float64
from gspure.errors import InputError

TOLERANCE: Final = 1e-3  # admits rotations printed with four digits, not scaled, sheared or mirrored ones


def require_rigid(source: Path | str, field: str, transform: Float64) -> None:
    """Raise `InputError` for the `field` of a source unless a finite matrix [3,3] is a rotation, or [4,4] rigid."""
    rotation, last = transform[:3, :3], transform[3:].ravel().tolist()
    with np.errstate(all="ignore"):  # of numbers that are very large or very small
        error, volume = np.abs(rotation @ rotation.T - np.eye(3)).max(), np.linalg.det(rotation)
    if not (error <= TOLERANCE and volume > 0):
        found = f"|R R^T - 1| = {error:.3g}, det R = {volume:.3g}"
        raise InputError(source, field, expected="a rotation without scale, shear or mirroring", found=found)
    if last not in ([], [0, 0, 0, 1]):
        raise InputError(source, field, expected="0 0 0 1 in the last row", found=" ".join(map(str, last)))
