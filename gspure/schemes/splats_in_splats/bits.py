r"""The hidden colours in the low bits of the shown ones: importance-graded embedding (arXiv 2412.03121).

Both are spherical-harmonic coefficients, as IEEE-754 words of 32 bits. Of the n coefficients of a channel, number j (of
degree :math:`\lfloor\sqrt j\rfloor`) gives up its low

.. math:: b_j = k + \lfloor\sqrt j\rfloor

bits to the leading bits of the hidden coefficient number n - 1 - j: what matters most of the hidden colour, its zeroth
harmonic, gets the most room, in the shown coefficient that matters least. Signs and exponents of the shown colour stay
as they are for b <= 23. The paper does not say how its integers represent numbers; IEEE words are our choice: they
survive a float32 file exactly.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Words = NDArray[np.uint32]

WORD: Final = 32
SHIFT: Final = 17
"""k of the paper."""

SHIFT_RANGE: Final = (9, 20)
"""Least: sign and exponent of a hidden word fit. Most: no exponent of a shown word is touched, at degree 3. Ours."""

LARGEST: Final = 8.0
"""Magnitudes above this, which no trained colour has, come from words that were tampered with. Ours."""


def embed(shown: Float32, hidden: Float32, shift: int = SHIFT) -> Float32:
    """Return `shown` [K,n,3] with `hidden` [K,n,3] in its low bits."""
    room = _room(shown.shape[1], shift)
    cleared = _words(shown) & ~_low(room)
    return (cleared | _words(hidden)[:, ::-1] >> (WORD - room)).view(np.float32)


def extract(carrier: Float32, shift: int = SHIFT) -> Float32:
    """Return the hidden coefficients [K,n,3], each in the middle of what its bits leave open.

    Words that were tampered with may mean anything: what is no number gives 0, what is too large `LARGEST`.
    """
    room = _room(carrier.shape[1], shift)
    words = (_words(carrier) & _low(room)) << (WORD - room) | np.uint32(1) << (WORD - 1 - room)
    hidden = words[:, ::-1].copy().view(np.float32)
    return np.nan_to_num(hidden, nan=0.0).clip(-LARGEST, LARGEST)


def _room(count: int, shift: int) -> Words:
    """Return b_j, to be broadcast over [K,n,3]."""
    return np.array([shift + int(j**0.5) for j in range(count)], np.uint32)[:, None]


def _low(room: Words) -> Words:
    return (np.uint32(1) << room) - np.uint32(1)


def _words(coefficients: Float32) -> Words:
    return np.ascontiguousarray(coefficients, np.float32).view(np.uint32)
