r"""The pattern: a sign for each cell of a world grid and each colour channel, from a keyed hash.

.. math:: c_k \leftarrow c_k + \varepsilon\, s_\kappa(\mathrm{cell}(x_k))

The key :math:`\kappa` is HMAC-SHA256 of the clean model's file under the owner's secret. So the pattern of a model
exists only for the clean model that was there before it: whoever names another model as the clean one has another
pattern.
"""

import hashlib
import hmac
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Bools, Float32, Float64, Indices
from gspure.constants import SH_DC
from gspure.model.gaussians import COLOUR, Gaussians

Cells = NDArray[np.uint64]

PER_RADIUS: Final = 24  # cells along the radius of the scene; larger and smaller ones survive less; ours
INNER: Final = 0.9  # share of the centres within the radius; ours
LEAST_RADIUS: Final = 1e-30  # of rows in one place
MOST: Final = 2**20 - 1  # largest number of cells from the centre along an axis; farther ones count as the last

_WORD: Final = np.dtype("<u8")
_MULTIPLIERS: Final = np.array([0xBF58476D1CE4E5B9, 0x94D049BB133111EB], _WORD)  # of SplitMix64 (Steele et al. 2014)
_SHIFTS: Final = np.array([30, 27, 31], _WORD)


class Grid(NamedTuple):
    """Cubic cells around the median of a model's centres."""

    centre: Float64  # [3]
    side: float  # of a cell, world units

    @classmethod
    def of(cls, model: Gaussians) -> Self:
        """Return the grid of a model, which a few floaters do not change."""
        means = model.means.astype(np.float64)
        centre = np.median(means, axis=0)
        radius = float(np.quantile(np.linalg.norm(means - centre, axis=1), INNER))
        return cls(centre, max(radius, LEAST_RADIUS) / PER_RADIUS)

    def cells(self, model: Gaussians) -> Cells:
        """Return the number of the cell [K] that holds each centre."""
        places = np.floor((model.means.astype(np.float64) - self.centre) / self.side)
        x, y, z = (np.clip(places, -MOST, MOST) + MOST).astype(np.uint64).T
        return np.asarray((x << np.uint64(42)) | (y << np.uint64(21)) | z)


@dataclass(frozen=True, eq=False)
class Pattern:
    """The signs that carry a message: each cell and channel belongs to one bit, which keeps or inverts its sign."""

    words: Cells  # [4], the key
    bits: Bools  # [N], the message

    @classmethod
    def of(cls, secret: bytes, clean_digest: bytes, bits: Bools) -> Self:
        """Return the pattern of a secret for a clean model, given by the SHA-256 of its file."""
        key = hmac.new(secret, clean_digest, hashlib.sha256).digest()
        return cls(np.frombuffer(key, _WORD), bits)

    def signs(self, cells: Cells) -> tuple[Float32, Indices]:
        """Return the signs [C,3] of cells for a message of ones, and the bit [C,3] that each belongs to."""
        hashes = cells
        for word in self.words:
            hashes = _mixed(hashes ^ word)
        channels = np.arange(3, dtype=np.uint64)
        is_plus = (hashes[:, None] >> channels) & np.uint64(1)
        fields = (hashes[:, None] >> (np.uint64(16) * (channels + np.uint64(1)))) & np.uint64(0xFFFF)
        owners = fields * np.uint64(len(self.bits)) >> np.uint64(16)
        return np.where(is_plus, np.float32(1), np.float32(-1)), owners.astype(np.intp)

    def mark(self, cells: Cells) -> Float32:
        """Return the signs [C,3] of cells for the message."""
        signs, owners = self.signs(cells)
        return np.where(self.bits[owners], signs, -signs)


def marked(model: Gaussians, grid: Grid, pattern: Pattern, strength: float) -> Gaussians:
    """Return a model whose colours (0 to 1) differ by `strength` in every cell and channel."""
    cells, places = np.unique(grid.cells(model), return_inverse=True)
    return recoloured(model, strength * pattern.mark(cells)[places])


def recoloured(model: Gaussians, changes: NDArray[Any]) -> Gaussians:
    """Return a model after changes [K,3] of its view-independent colours (0 to 1)."""
    shifts = changes.astype(np.float64) / SH_DC
    return model.with_columns(
        {name: (model.table[name] + shift).astype(np.float32) for name, shift in zip(COLOUR, shifts.T, strict=True)}
    )


def _mixed(words: Cells) -> Cells:
    """Return the finalizer of SplitMix64, a bijection of 64-bit words."""
    words = (words ^ (words >> _SHIFTS[0])) * _MULTIPLIERS[0]
    words = (words ^ (words >> _SHIFTS[1])) * _MULTIPLIERS[1]
    return np.asarray(words ^ (words >> _SHIFTS[2]))
