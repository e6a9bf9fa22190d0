"""Splats in Splats: hidden bits, the opacity mapping, training and extraction."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from threadpoolctl import threadpool_limits

from gspure.attacks import Measurements, find_attack
from gspure.method.pruning import plain_prune_mask
from gspure.method.weights import accumulate
from gspure.metrics.image_metrics import psnr
from gspure.model import read_model, write_model
from gspure.model.summary import kind
from gspure.schemes.hidden_weight import hidden_weights, share_on_low
from gspure.schemes.matching import registered
from gspure.schemes.scheme import hide
from gspure.schemes.splats_in_splats import HARDENED, SCHEME, opacity_mapping
from gspure.schemes.splats_in_splats.bits import LARGEST, SHIFT, SHIFT_RANGE, embed, extract
from gspure.schemes.splats_in_splats.opacity_mapping import OpacityMapping, fit
from tests.models import blobs, without
from tests.scheme_cases import quality

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
    extracted = extract(embed(shown, hidden, shift), shift)
    bits = room(shown.shape[1], shift)[::-1]  # hidden coefficient j lies in slot n - 1 - j
    half_step = 2.0 ** -(bits - 8)  # sign and exponent take 9 bits; extracted values lie in the middle
    assert (np.abs(extracted - hidden) <= half_step * np.abs(hidden) + 2.0**-120).all()


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
    shown, hidden = pair
    marked = embed(shown, hidden)
    assert embed(marked, extract(marked)).tobytes() == marked.tobytes() or (np.abs(hidden) < 2.0**-100).any()


def test_the_zeroth_harmonic_has_the_most_room():
    shown, hidden = np.zeros((2, 1, 16, 3), np.float32)
    hidden[:, 0] = 1.2345678
    assert embed(shown, hidden)[:, 15].all()
    assert not embed(shown, hidden)[:, :15].any()


def test_invalid_values_become_finite_and_bounded():
    rng = np.random.default_rng(0)
    words = rng.integers(0, 2**32, (4096, 16, 3), dtype=np.uint32)
    extracted = extract(words.view(np.float32), SHIFT)
    assert np.isfinite(extracted).all()
    assert np.abs(extracted).max() == LARGEST
    assert not extract(np.full((1, 16, 3), 0xFFFFFFFF, np.uint32).view(np.float32)).any()  # not-a-number


def sequence(count, seed=0):
    rng = np.random.default_rng(seed)
    shown = rng.uniform(0, 1, count).astype(np.float32)
    return shown, (0.9 - 0.6 * shown).astype(np.float32)


def as_double(mapping):
    return OpacityMapping(tuple(array.astype(np.float64) for array in mapping.weights))


@pytest.mark.parametrize("count", [1, 4, 13, 30])
def test_gradients_agree_with_differences(count):
    mapping = as_double(OpacityMapping.fresh(np.random.default_rng(1)))
    shown, hidden = sequence(count)
    weights = mapping.weights
    gradients = opacity_mapping._gradients(weights, shown, hidden)
    rng = np.random.default_rng(2)
    for array, gradient in zip(weights, gradients, strict=True):
        place = tuple(rng.integers(n) for n in array.shape)
        losses = []
        for step in (1e-5, -1e-5):
            array[place] += step
            losses.append(np.mean((mapping(shown) - hidden) ** 2))
            array[place] -= step
        assert gradient[place] == pytest.approx((losses[0] - losses[1]) / 2e-5, rel=1e-3, abs=1e-7)


def test_the_number_of_threads_changes_no_bit(monkeypatch):
    monkeypatch.setattr(opacity_mapping, "STEPS", 5)
    shown, hidden = sequence(1000)  # of this length, several threads of OpenBLAS add in another order
    written = []
    for threads in (1, 4):
        with threadpool_limits(threads, "blas"):
            mapping = fit(shown, hidden, np.random.default_rng(0))
            written.append([array.tobytes() for array in (*mapping.weights, mapping(shown))])
    assert written[0] == written[1]


SETTINGS = {"iterations": 300, "max_gaussians": 3000}
LITERAL, ADAPTIVE = SCHEME.extractions


@pytest.fixture(scope="module")
def embedded(pair):
    return hide(SCHEME, pair, **SETTINGS)


@pytest.fixture(scope="module")
def public(embedded):
    return embedded[0]


@pytest.fixture(scope="module")
def key(embedded):
    return embedded[1]


def test_scene_and_message_can_both_be_seen(public, key, pair):
    mean_colour = np.mean([psnr(image, np.full_like(image, image.mean())) for image in pair.message.images])
    assert kind(public.model).startswith("vanilla 3DGS")
    assert quality(public.scene(), pair.scene) > 20
    assert quality(key.message(public, ADAPTIVE), pair.message) > mean_colour + 6
    assert quality(key.message(public, LITERAL), pair.message) > mean_colour + 4


def test_a_hardened_message_lies_on_rows_that_the_scene_needs_and_outlives_their_pruning(pair, embedded):
    def left(scheme_public, scheme_key):
        """Share of the message on low rows, and its PSNR before and after they are pruned."""
        weights = accumulate(map(scheme_public.contributions(), pair.scene.views), len(scheme_public.model))
        hidden = hidden_weights(scheme_public, scheme_key, ADAPTIVE, pair.message.views, "ray")
        pruned = without(scheme_public, plain_prune_mask(weights, 2.0))
        psnrs = [quality(scheme_key.message(public, LITERAL), pair.message) for public in (scheme_public, pruned)]
        return share_on_low(weights, hidden, 2.0), *psnrs

    hardened = hide(HARDENED, pair, **SETTINGS)
    low, before, after = left(*hardened)
    published_low, published_before, published_after = left(*embedded)
    assert low < 0.1 < published_low
    assert before - after < 0.5 < published_before - published_after - 3
    assert after > published_after + 1
    assert quality(embedded[0].scene(), pair.scene) - quality(hardened[0].scene(), pair.scene) < 1


def test_the_message_is_read_from_what_survives_in_any_order(public, key):
    rng = np.random.default_rng(0)
    kept = rng.permutation(len(public.model))[: len(public.model) // 2]
    attacked = public.with_model(type(public.model)(public.model.table[kept]))
    for extraction in SCHEME.extractions:
        whole, rows = key.revealed(public, extraction)
        part, survivors = key.revealed(attacked, extraction)
        place = {row: i for i, row in enumerate(rows)}
        same = whole.table[[place[row] for row in kept[survivors]]]
        for name in part.table.dtype.names:
            if extraction != LITERAL or name != "opacity":  # the mapping looks at neighbours, which may be gone
                assert part.table[name].tobytes() == same[name].tobytes()


@pytest.mark.parametrize(
    ("attack", "settings"),
    [
        ("position_noise", {"sigma": 1e-3}),
        ("finetune", {"iterations": 60}),
        ("rigid_transform", {"angle": 75.0, "axis": "1,2,-1", "translation": "1,1,0"}),
    ],
)
def test_the_adaptive_extraction_matches_rows_that_moved(public, key, pair, attack, settings):
    attacked = find_attack(attack).apply(public, Measurements(), cameras=pair.scene.views, **settings)
    moved = public.with_model(attacked.model)
    before = quality(key.message(public, ADAPTIVE), pair.message)
    back = registered(moved, public.model)
    assert quality(key.message(back, ADAPTIVE), pair.message) == pytest.approx(before, abs=0.3)
    assert quality(key.message(moved, LITERAL), pair.message) < before - 3


def test_the_shift_is_the_papers_and_its_range_the_widest_that_works():
    assert (SHIFT, LARGEST) == (17, 8)
    ones = np.ones((1, 16, 3), np.float32)
    twos = np.full((1, 16, 3), 2, np.float32)
    fewest, most = SHIFT_RANGE
    assert (np.abs(extract(embed(ones, twos, fewest), fewest) - 2) <= 1).all()
    assert (np.abs(extract(embed(ones, twos, fewest - 1), fewest - 1) - 2) > 1).any()  # an exponent lost a bit
    assert (embed(ones, twos, most) >= 1).all()
    assert (embed(ones, twos, most + 1) < 1).any()  # an exponent was overwritten


def test_hidden_bits_survive_a_file_but_not_scaling(tmp_path):
    model = blobs(50, sh_degree=3)
    hidden = np.random.default_rng(1).normal(0, 0.3, (50, 16, 3)).astype(np.float32)
    write_model(tmp_path / "a.ply", model.with_appearance(model.table["opacity"], embed(model.sh_coeffs, hidden)))
    stored = read_model(tmp_path / "a.ply").sh_coeffs
    np.testing.assert_allclose(extract(stored), hidden, rtol=2.0**-7)
    assert np.median(np.abs(extract((1.2 * stored).astype(np.float32)) - hidden)) > np.median(np.abs(hidden)) / 2
