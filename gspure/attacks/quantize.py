"""Quantization of stored values, as files for the web do it."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from gspure.attacks.attack import Attack, Attacked, Rng
from gspure.attacks.attributes import columns_of
from gspure.attacks.settings import require
from gspure.model.gaussians import Gaussians

Float32 = NDArray[np.float32]

BITS: Final = 8
ATTRIBUTES: Final = "colour,opacity,scale,rotation"
"""Ours: positions are left alone, for which formats keep 16 bits and more; with few bits, nothing else would matter."""

HALF: Final = 16
"""Bits of IEEE-754 half precision."""


def quantize(model: Gaussians, _rng: Rng, *, bits: int = BITS, attributes: str = ATTRIBUTES) -> Attacked:
    """Round stored values to few bits each.

    Parameters
    ----------
    model : Gaussians
    bits : int
        16: half precision. 1 to 8: 2^bits equally spaced levels from a column's least value to its greatest.
    attributes : str
        Of ``colour``, ``base_colour``, ``opacity``, ``scale``, ``rotation``, ``position``.

    """
    require("quantize", "bits", bits, "1 to 8, or 16", fits=bits in {*range(1, 9), HALF})
    columns = columns_of(model, attributes)
    round_off = _half if bits == HALF else lambda values: _uniform(values, 2**bits)
    return Attacked.changed(model, {name: round_off(model.table[name]) for name in columns})


def _half(values: Float32) -> Float32:
    """Return the nearest numbers of half precision; what is too large for it becomes its largest."""
    largest = np.finfo(np.float16).max
    return np.clip(values, -largest, largest).astype(np.float16).astype(np.float32)


def _uniform(values: Float32, levels: int) -> Float32:
    """Return the nearest of `levels` equally spaced numbers from the least of `values` to the greatest."""
    if not len(values) or values.min() == values.max():
        return values
    least, greatest = float(values.min()), float(values.max())
    step = (greatest - least) / (levels - 1)
    rounded: Float32 = (least + step * np.rint((values.astype(np.float64) - least) / step)).astype(np.float32)
    return rounded


ATTACK = Attack("quantize", quantize)
