r"""Hidden colours in the low bits of the public ones: importance-graded embedding (arXiv 2412.03121).

Both are spherical-harmonic coefficients, as IEEE-754 words of 32 bits. Public coefficient j of the n of a channel (of
degree :math:`\lfloor\sqrt j\rfloor`) gives up its low

.. math:: b_j = k + \lfloor\sqrt j\rfloor

bits to the leading bits of the hidden coefficient number n - 1 - j. So the zeroth hidden harmonic, the most important
one, gets the most bits, in the least important public coefficient. Signs and exponents of the public colour are
unchanged for b <= 23. The paper does not say how its integers represent numbers. IEEE words are our choice: a float32
file stores them exactly.
"""

from typing import Final

import numpy as np

from gspure.arrays import Float32, UInt32

Words = UInt32

WORD: Final = 32
SHIFT: Final = 17  # k of the paper

SHIFT_RANGE: Final = (9, 20)
"""Lower: sign and exponent of a hidden word fit. Upper: exponents of public words are unchanged at degree 3. Ours."""

LARGEST: Final = 8.0  # largest extracted magnitude: no trained colour has it, but changed words may; ours


def embed(shown: Float32, hidden: Float32, shift: int = SHIFT) -> Float32:
    """Return `shown` [K,n,3] with `hidden` [K,n,3] in its low bits."""
    room = _room(shown.shape[1], shift)
    cleared = _words(shown) & ~_low(room)
    return (cleared | _words(hidden)[:, ::-1] >> (WORD - room)).view(np.float32)


def extract(public: Float32, shift: int = SHIFT) -> Float32:
    """Return the hidden coefficients [K,n,3], each in the middle of the interval that its bits define.

    Changed words may represent anything: not-a-number gives 0, and magnitudes are clipped to `LARGEST`.
    """
    room = _room(public.shape[1], shift)
    words = (_words(public) & _low(room)) << (WORD - room) | np.uint32(1) << (WORD - 1 - room)
    hidden = words[:, ::-1].copy().view(np.float32)
    return np.nan_to_num(hidden, nan=0.0).clip(-LARGEST, LARGEST)


def redrawn(public: Float32, rng: np.random.Generator) -> Float32:
    """Return colours [K,n,3] with random low bits, as many as any shift uses."""
    low = _low(_room(public.shape[1], SHIFT_RANGE[1]))
    random = rng.integers(1 << WORD, size=public.shape, dtype=np.uint32)
    return (_words(public) & ~low | random & low).view(np.float32)


def _room(count: int, shift: int) -> Words:
    """Return b_j [n,1], which broadcasts over [K,n,3]."""
    return np.array([shift + int(j**0.5) for j in range(count)], np.uint32)[:, None]


def _low(room: Words) -> Words:
    return (np.uint32(1) << room) - np.uint32(1)


def _words(coefficients: Float32) -> Words:
    return np.ascontiguousarray(coefficients, np.float32).view(np.uint32)
