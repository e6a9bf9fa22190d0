r"""The rank of a keyed pattern among keys: exact for whatever was made without the key.

A pattern is a vector s of random signs, and the evidence for it the largest of T sums

.. math:: S = \max_t \langle v_t, s \rangle

whose values v were measured without the key. So, without the mark, S is drawn like its value for any other key,
whatever the v are: those of N other keys give an exact p-value.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float64
from gspure.metrics.proof import rank_p

KEYS: Final = 9_999  # other keys, unless more are wanted; ours
BATCH: Final = 1 << 14  # keys at a time; ours
BYTE: Final = 8  # signs whose sums a table holds


class Certificate(NamedTuple):
    """How a pattern ranks among those of other keys."""

    p: float  # at least 1 / (keys + 1)
    z: float  # the largest sum; a standard score, if the values of a try have norm 1
    keys: int


def certificate(values: NDArray[Any], pattern: NDArray[Any], keys: int = KEYS) -> Certificate:
    """Return the rank of a pattern [M] of signs by the largest of its sums with values [T,M]."""
    if not len(values):
        return Certificate(1.0, 0.0, keys)
    z = float(np.max(values @ pattern))
    return Certificate(rank_p(z, largest_sums(values, keys)), z, keys)


def largest_sums(values: NDArray[Any], keys: int) -> Float64:
    """Return the largest sum with values [T,M] for each of some random patterns: [keys].

    A table holds the sums of eight values for all patterns of eight signs, so a byte of random bits adds eight at once.
    """
    padded = np.pad(values, ((0, 0), (0, -values.shape[1] % BYTE))).reshape(len(values), -1, BYTE)
    signs = 2.0 * np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1) - 1
    tables = np.einsum("tgb,sb->gst", padded, signs).astype(np.float32)
    rng = np.random.default_rng(0)
    largest = np.empty(keys)
    for first in range(0, keys, BATCH):
        count = min(BATCH, keys - first)
        sums = np.zeros((count, len(values)), np.float32)
        for table in tables:
            sums += table[rng.integers(256, size=count, dtype=np.uint8)]
        largest[first : first + count] = sums.max(axis=1)
    return largest
