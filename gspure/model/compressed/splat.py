"""``.splat``: 32 bytes per Gaussian, without a header and without spherical harmonics beyond the zeroth."""

from pathlib import Path
from typing import Final

import numpy as np

from gspure.errors import InputError, reading
from gspure.model.compressed.quantization import byte_logits, colour_coeffs, positive_log
from gspure.model.gaussians import Gaussians

_ROW: Final = np.dtype([("mean", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("quat", "u1", 4)])
_TOLERANCE: Final = 0.1  # of the length of quaternions; that of other content is at random


def read_splat(path: Path) -> Gaussians:
    """Read a ``.splat`` file."""
    with reading(path, "a .splat model"):
        size = path.stat().st_size
        if not size or size % _ROW.itemsize:
            raise InputError(path, "file", expected=f"rows of {_ROW.itemsize} bytes", found=f"{size} bytes")
        rows = np.fromfile(path, _ROW)
        quats = (rows["quat"].astype(np.float32) - 128) / 128
        if not np.median(np.abs(np.linalg.norm(quats, axis=1) - 1)) < _TOLERANCE:
            hint = "is this a .splat file?"
            raise InputError(path, "rotations", expected="unit quaternions", found="other lengths", hint=hint)
        return Gaussians.from_stored(
            means=rows["mean"],
            quats=quats,
            log_scales=positive_log(rows["scale"]),
            opacity_logits=byte_logits(rows["rgba"][:, 3]),
            sh_coeffs=colour_coeffs(rows["rgba"][:, None, :3] / 255),
        )
