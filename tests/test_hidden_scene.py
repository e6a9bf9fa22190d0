"""Splats in Splats: hidden bits, the opacity mapping, training, extraction, and the matching of rows that moved."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from threadpoolctl import threadpool_limits

from gspure.arrays import save_array
from gspure.attacks import Measurements, find_attack
from gspure.cameras import write_cameras
from gspure.cli import main
from gspure.images import read_image
from gspure.method.pruning import plain_prune_mask
from gspure.method.weights import accumulate
from gspure.metrics.image_metrics import psnr
from gspure.model import Gaussians, write_model
from gspure.model.rotations import moved
from gspure.model.summary import kind
from gspure.public_model import PublicModel
from gspure.schemes.hidden_weight import hidden_weights, share_on_low
from gspure.schemes.matching import adaptive_matches, exact_matches, registered
from gspure.schemes.scheme import hide
from gspure.schemes.splats_in_splats import HARDENED, SCHEME, opacity_mapping
from gspure.schemes.splats_in_splats.bits import LARGEST, SHIFT, SHIFT_RANGE, embed, extract
from gspure.schemes.splats_in_splats.key import SplatsInSplatsKey
from gspure.schemes.splats_in_splats.opacity_mapping import OpacityMapping, fit
from tests.models import blobs, camera, without
from tests.scheme_cases import quality

colours = st.sampled_from((1, 4, 9, 16)).flatmap(
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


def test_invalid_values_become_finite_and_bounded():
    words = np.random.default_rng(0).integers(0, 2**32, (4096, 16, 3), dtype=np.uint32)
    extracted = extract(words.view(np.float32), SHIFT)
    assert np.isfinite(extracted).all()
    assert np.abs(extracted).max() == LARGEST
    assert not extract(np.full((1, 16, 3), 0xFFFFFFFF, np.uint32).view(np.float32)).any()  # not-a-number


def sequence(count, seed=0):
    shown = np.random.default_rng(seed).uniform(0, 1, count).astype(np.float32)
    return shown, (0.9 - 0.6 * shown).astype(np.float32)


@pytest.mark.parametrize("count", [1, 30])
def test_gradients_agree_with_differences(count):
    weights = tuple(array.astype(np.float64) for array in OpacityMapping.fresh(np.random.default_rng(1)).weights)
    mapping = OpacityMapping(weights)
    shown, hidden = sequence(count)
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


def test_scene_and_message_can_both_be_seen(embedded, pair):
    public, key = embedded
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


def test_the_message_is_read_from_what_survives_in_any_order(embedded):
    public, key = embedded
    kept = np.random.default_rng(0).permutation(len(public.model))[: len(public.model) // 2]
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
def test_the_adaptive_extraction_matches_rows_that_moved(embedded, pair, attack, settings):
    public, key = embedded
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


def test_injected_rows_do_not_hide_those_of_the_original_and_a_foreign_model_does_not_match():
    original = blobs(100)
    foreign = blobs(300, seed=1)
    far = foreign.with_columns({"x": foreign.table["x"] + 1000})
    injected = Gaussians(np.concatenate([far.table, original.table]))
    np.testing.assert_array_equal(adaptive_matches(original, injected), np.r_[np.full(300, -1), np.arange(100)])
    assert (adaptive_matches(original, blobs(10000, seed=1)) < 0).all()


@pytest.mark.parametrize("far", [0.0, 6e4, 1e30])
def test_a_far_row_of_the_original_does_not_widen_what_is_exact(far):
    original = blobs(100).means.copy()
    original[0, 0] += far
    assert (exact_matches(original, original[1:] + np.float32(1e-4)) < 0).all()
    assert exact_matches(original, original).tolist() == list(range(100))


@pytest.mark.parametrize("scale", [1.0, 0.2, 3.0])
def test_an_unknown_motion_of_a_pruned_and_noisy_model_is_undone(scale):
    original = blobs(400)
    rng = np.random.default_rng(0)
    kept = without(PublicModel(original), rng.random(400) < 0.3).model
    noisy = kept.with_columns({"x": kept.table["x"] + rng.normal(0, 1e-4, len(kept)).astype(np.float32)})
    attacked = PublicModel(moved(noisy, np.array([0.5, -1.0, 2.0]), np.array([3.0, 0.0, -7.0]), scale))
    back = registered(attacked, original).model
    for name in noisy.table.dtype.names:
        np.testing.assert_allclose(back.table[name], noisy.table[name], atol=5e-3, err_msg=name)


@pytest.mark.parametrize("count", [0, 1, 100])
def test_a_model_that_did_not_move_or_is_foreign_stays_bit_identical(count):
    original = blobs(100)
    for model in (original, original[: count or 1], blobs(count, seed=1) if count else original[:0]):
        public = PublicModel(model)
        assert registered(public, original) is public


def test_extract_undoes_an_unknown_motion(tmp_path):
    model = blobs(200)
    SplatsInSplatsKey(model.means, OpacityMapping.fresh(np.random.default_rng(0)), 12, model).write(tmp_path / "key")
    write_model(tmp_path / "model.ply", model)
    write_model(tmp_path / "moved.ply", moved(model, np.array([0.5, -1.0, 2.0]), np.array([3.0, 0.0, -7.0]), 2.0))
    write_cameras(tmp_path / "cameras.json", [camera()])
    save_array(tmp_path / "transform.npy", np.eye(4))

    def extract(name, *options):
        words = ["--scheme", "splats_in_splats", "--key", tmp_path / "key", "--extraction", "message_adaptive"]
        words += ["--cameras", tmp_path / "cameras.json", "--out", tmp_path / name, *options]
        return main(["extract", *map(str, (tmp_path / f"{name}.ply", *words))])

    original = ["--original", tmp_path / "model.ply"]
    assert extract("model") == extract("moved") == 0
    before, lost = (read_image(tmp_path / name / "view.png") for name in ("model", "moved"))
    assert psnr(before, lost) < 20
    assert extract("moved", *original) == 0
    assert psnr(before, read_image(tmp_path / "moved" / "view.png")) > 40
    assert extract("moved", *original, "--transform", tmp_path / "transform.npy") == 2
