"""Splats in Splats from pair to purified model, small."""

import numpy as np
import pytest
from numpy.lib import recfunctions as rfn

from gspure.attacks import Measurements, find_attack
from gspure.cameras import read_cameras, split
from gspure.cli import main
from gspure.errors import InputError
from gspure.evaluation.metrics import psnr
from gspure.images import read_image
from gspure.method.pruning import plain_prune_mask
from gspure.method.weights import accumulate
from gspure.model import Gaussians, read_model, write_model
from gspure.model.signature import Signature
from gspure.schemes.hidden_weight import hidden_weights, share_on_low
from gspure.schemes.matching import registered
from gspure.schemes.pair import read_pair
from gspure.schemes.scheme import hide
from gspure.schemes.splats_in_splats import HARDENED, SCHEME
from gspure.schemes.splats_in_splats.key import SplatsInSplatsKey
from gspure.schemes.splats_in_splats.opacity_mapping import OpacityMapping
from tests.models import blobs, without

SETTINGS = {"iterations": 300, "max_gaussians": 3000}
LITERAL, ADAPTIVE, ORACLE = SCHEME.extractions


@pytest.fixture(scope="module")
def pair(pair_folder):
    return read_pair(pair_folder)


@pytest.fixture(scope="module")
def embedded(pair):
    return hide(SCHEME, pair, **SETTINGS)


@pytest.fixture(scope="module")
def public(embedded):
    return embedded[0]


@pytest.fixture(scope="module")
def key(embedded):
    return embedded[1]


@pytest.fixture(scope="module")
def clean(pair):
    public, key = hide(SCHEME, pair, message_weight=0, **SETTINGS)
    assert key is None
    return public


@pytest.fixture(scope="module")
def quality(pair_folder):
    """Mean PSNR of a view's held-out images: `quality(view, "message")`."""
    test = split(read_cameras(pair_folder / "cameras.json"))[1]

    def measured(view, kind="message"):
        files = [pair_folder / kind / f"{camera.name}.png" for camera in test]
        return np.mean([psnr(view(c).clip(0, 1), read_image(f)) for c, f in zip(test, files, strict=True)])

    return measured


def test_scene_and_message_can_both_be_seen(public, key, quality, pair):
    mean_colour = np.mean([psnr(image, np.full_like(image, image.mean())) for image in pair.message.images])
    assert quality(public.scene(), "scene") > 20
    assert quality(key.message(public, ORACLE)) > mean_colour + 6
    assert quality(key.message(public, LITERAL)) > mean_colour + 4


def test_a_hardened_message_lies_on_rows_that_the_scene_needs_and_outlives_their_pruning(pair, embedded, quality):
    def left(scheme_public, scheme_key):
        """Share of the message on low rows, and its PSNR before and after they are pruned."""
        weights = accumulate(map(scheme_public.contributions(), pair.scene.views), len(scheme_public.model))
        hidden = hidden_weights(scheme_public, scheme_key, ORACLE, pair.message.views, "ray")
        pruned = without(scheme_public, plain_prune_mask(weights, 2.0))
        psnrs = [quality(scheme_key.message(public, LITERAL)) for public in (scheme_public, pruned)]
        return share_on_low(weights, hidden, 2.0), *psnrs

    hardened = hide(HARDENED, pair, **SETTINGS)
    low, before, after = left(*hardened)
    published_low, published_before, published_after = left(*embedded)
    assert low < 0.1 < published_low
    assert before - after < 0.5 < published_before - published_after - 3
    assert after > published_after + 1
    assert quality(embedded[0].scene(), "scene") - quality(hardened[0].scene(), "scene") < 1


def test_a_wrong_key_shows_less(public, key, quality):
    stranger = key.wrong(np.random.default_rng(1))
    for extraction in SCHEME.extractions:
        right, wrong = quality(key.message(public, extraction)), quality(stranger.message(public, extraction))
        assert wrong < right - 3


def test_the_public_file_is_a_vanilla_model_and_reads_back_exactly(public, key, tmp_path):
    public.write(tmp_path / "public" / "point_cloud.ply")
    key.write(tmp_path / "key")
    again, opened = SCHEME.read_public(tmp_path / "public"), SCHEME.read_key(tmp_path / "key")
    assert Signature.of(again.model.table.dtype.names) is Signature.VANILLA
    assert again.model.table.tobytes() == public.model.table.tobytes()
    for extraction in SCHEME.extractions:
        one, other = (k._revealed(a, extraction)[0].table for k, a in ((key, public), (opened, again)))
        assert one.tobytes() == other.tobytes()


def test_the_message_is_read_from_what_survives_in_any_order(public, key):
    rng = np.random.default_rng(0)
    kept = rng.permutation(len(public.model))[: len(public.model) // 2]
    attacked = public.with_model(type(public.model)(public.model.table[kept]))
    for extraction in SCHEME.extractions:
        whole, rows = key._revealed(public, extraction)
        part, survivors = key._revealed(attacked, extraction)
        place = {row: i for i, row in enumerate(rows)}
        same = whole.table[[place[row] for row in kept[survivors]]]
        for name in part.table.dtype.names:
            if extraction != LITERAL or name != "opacity":  # the mapping looks at neighbours, which may be gone
                assert part.table[name].tobytes() == same[name].tobytes()


def test_noise_on_the_colours_ends_the_literal_message_and_not_the_oracle_one(public, key, quality):
    noisy = public.model.sh_coeffs + np.random.default_rng(0).normal(0, 1e-3, public.model.sh_coeffs.shape)
    attacked = public.with_model(public.model.with_appearance(public.model.table["opacity"], noisy.astype(np.float32)))
    assert quality(key.message(attacked, LITERAL)) < quality(key.message(public, LITERAL)) - 3
    assert quality(key.message(attacked, ORACLE)) == quality(key.message(public, ORACLE))


@pytest.mark.parametrize(
    ("attack", "settings"),
    [
        ("position_noise", {"sigma": 1e-3}),
        ("finetune", {"iterations": 60}),
        ("rigid_transform", {"angle": 75.0, "axis": "1,2,-1", "translation": "1,1,0"}),
    ],
)
def test_the_adaptive_extraction_matches_rows_that_moved(public, key, quality, pair, attack, settings):
    attacked = find_attack(attack).apply(public, Measurements(), cameras=pair.scene.views, **settings)
    moved, before = public.with_model(attacked.model), quality(key.message(public, ORACLE))
    back = registered(moved, public.model)
    assert quality(key.message(back, ADAPTIVE)) == pytest.approx(before, abs=0.3)
    assert max(quality(key.message(moved, extraction)) for extraction in (LITERAL, ORACLE)) < before - 3


@pytest.mark.parametrize("attack", ["unattacked", "rigid_transform"])
def test_the_adaptive_extraction_matches_no_row_of_a_clean_model(key, clean, attack):
    attacked = clean.with_model(find_attack(attack).apply(clean, Measurements()).model)
    assert registered(attacked, key.hidden) is attacked
    assert not len(key.gaussians(attacked, None, ADAPTIVE)[0])


def test_low_weights_carry_the_message(public, key, quality, pair):
    contributions = public.contributions()
    weights = accumulate([contributions(camera) for camera in pair.scene.views], len(public.model))
    purified = without(public, plain_prune_mask(weights))
    lost = quality(key.message(public, ORACLE)) - quality(key.message(purified, ORACLE))
    assert lost > 5 + quality(public.scene(), "scene") - quality(purified.scene(), "scene")


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (
            {"positions": np.zeros((4, 2), np.float32)},
            r"positions: expected float32 \[any, 3\], found float32 \[4, 2\]",
        ),
        ({"kernel_1": np.zeros((3, 3), np.float32)}, r"kernel_1: expected float32 \[80, 32\], found"),
        ({"bias_0": np.full(16, np.nan, np.float32)}, "bias_0: expected finite numbers"),
        ({"positions": np.zeros((10**6, 3), np.float32)}, "positions: expected at most .*, found 1000000"),
        ({"shift": np.array(40)}, "shift: expected a whole number from 9 to 20, found 40"),
        ({"shift": None}, "shift: expected a key of Splats in Splats, found no such array"),
    ],
)
def test_a_broken_key_is_refused(key, tmp_path, change, line):
    key.write(tmp_path)
    with np.load(tmp_path / "splats_in_splats.npz") as archive:
        arrays = dict(archive) | change
    np.savez(tmp_path / "splats_in_splats.npz", **{name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(InputError, match=line):
        SCHEME.read_key(tmp_path)


@pytest.mark.parametrize("line", ["x: expected finite numbers", "columns: expected f_dc_0 to f_dc_2, found no colours"])
def test_hidden_gaussians_that_cannot_be_drawn_are_refused(key, tmp_path, line):
    key.write(tmp_path)
    hidden = read_model(file := tmp_path / "hidden.ply")
    if line.startswith("x"):
        changed = hidden.with_columns({"x": np.where(np.arange(len(hidden)) == 1, np.nan, hidden.means[:, 0])})
    else:
        changed = Gaussians(
            rfn.drop_fields(hidden.table, [name for name in hidden.table.dtype.names if name.startswith("f_")])
        )

    write_model(file, changed)
    with pytest.raises(InputError, match=line):
        SCHEME.read_key(tmp_path)


def test_a_key_that_fits_no_row_is_warned_of(tmp_path, capsys):
    model, rng = blobs(20), np.random.default_rng(0)
    SplatsInSplatsKey(model.means[:5], OpacityMapping.fresh(rng), 12, model).write(tmp_path / "key")
    write_model(tmp_path / "moved.ply", model.with_columns({axis: model.table[axis] + 100 for axis in "xyz"}))
    write_model(tmp_path / "model.ply", model)
    for name, fits in (("model", True), ("moved", False)):
        words = ["--scheme", SCHEME.name, "--cameras", "orbit", "--key", str(tmp_path / "key")]
        assert main(["extract", str(tmp_path / f"{name}.ply"), *words, "--out", str(tmp_path / name)]) == 0
        assert ("images are blank: the key does not match" in capsys.readouterr().err) != fits
