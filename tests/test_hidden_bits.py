"""Colours in the low bits of colours: what survives, what it costs, and what is made of nonsense."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from gspure.schemes.splats_in_splats.bits import LARGEST, SHIFT, SHIFT_RANGE, embed, extract

BANDS = (1, 4, 9, 16)
colours = st.sampled_from(BANDS).flatmap(
    lambda bands: arrays.arrays(
        np.float32, (2, 3, bands, 3), elements=st.floats(-4, 4, width=32, allow_subnormal=False)
    )
)
shifts = st.integers(*SHIFT_RANGE)


def room(bands, shift):
    """Bits that slot j gives up: k more than the degree."""
    return np.array([shift + int(np.sqrt(j)) for j in range(bands)])[:, None]


@given(colours, shifts)
def test_a_hidden_colour_comes_back_as_exactly_as_its_bits_allow(pair, shift):
    shown, hidden = pair
    found = extract(embed(shown, hidden, shift), shift)
    bits = room(shown.shape[1], shift)[::-1]  # hidden coefficient j lies in slot n - 1 - j
    half_step = 2.0 ** -(bits - 8)  # sign and exponent take 9 bits; what is extracted lies in the middle
    assert (np.abs(found - hidden) <= half_step * np.abs(hidden) + 2.0**-120).all()


@given(colours, shifts)
def test_a_shown_colour_keeps_sign_and_exponent_and_the_rest_of_its_bits(pair, shift):
    shown, hidden = pair
    marked = embed(shown, hidden, shift)
    bits = room(shown.shape[1], shift).astype(np.uint32)
    assert (marked.view(np.uint32) >> bits == shown.view(np.uint32) >> bits).all()
    assert np.isfinite(marked).all()
    assert (np.abs(marked - shown) <= 2.0 ** (bits.astype(float) - 23) * np.abs(shown) + 2.0**-120).all()


@given(colours)
def test_extraction_and_embedding_of_bits_are_inverse(pair):
    marked = embed(*pair)
    assert embed(marked, extract(marked)).tobytes() == marked.tobytes() or (np.abs(pair[1]) < 2.0**-100).any()


def test_the_zeroth_harmonic_has_the_most_room():
    shown, hidden = np.zeros((2, 1, 16, 3), np.float32)
    hidden[:, 0] = 1.2345678
    assert embed(shown, hidden)[:, 15].all()
    assert not embed(shown, hidden)[:, :15].any()


def test_invalid_values_become_finite_and_bounded():
    rng = np.random.default_rng(0)
    words = rng.integers(0, 2**32, (4096, 16, 3), dtype=np.uint32)
    found = extract(words.view(np.float32), SHIFT)
    assert np.isfinite(found).all()
    assert np.abs(found).max() == LARGEST
