"""Matching of the rows of an attacked model with those of the published one, and its motion."""

import numpy as np
import pytest

from gspure.arrays import save_array
from gspure.cameras import write_cameras
from gspure.cli import main
from gspure.images import read_image
from gspure.metrics.image_metrics import psnr
from gspure.model import Gaussians, write_model
from gspure.model.rotations import moved
from gspure.public_model import PublicModel
from gspure.schemes.matching import adaptive_matches, exact_matches, registered
from gspure.schemes.splats_in_splats.key import SplatsInSplatsKey
from gspure.schemes.splats_in_splats.opacity_mapping import OpacityMapping
from tests.models import blobs, camera, without


def test_injected_rows_do_not_hide_those_of_the_original():
    original = blobs(100)
    foreign = blobs(300, seed=1)
    far = foreign.with_columns({"x": foreign.table["x"] + 1000})
    injected = Gaussians(np.concatenate([far.table, original.table]))
    np.testing.assert_array_equal(adaptive_matches(original, injected), np.r_[np.full(300, -1), np.arange(100)])


@pytest.mark.parametrize("far", [0.0, 6e4, 1e30])
def test_a_far_row_of_the_original_does_not_widen_what_is_exact(far):
    original = blobs(100).means.copy()
    original[0, 0] += far
    moved_rows = original[1:] + np.float32(1e-4)
    assert (exact_matches(original, moved_rows) < 0).all()
    assert exact_matches(original, original).tolist() == list(range(100))


def test_a_foreign_model_of_many_rows_does_not_match():
    assert (adaptive_matches(blobs(100), blobs(10000, seed=1)) < 0).all()


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
    mapping = OpacityMapping.fresh(np.random.default_rng(0))
    SplatsInSplatsKey(model.means, mapping, 12, model).write(tmp_path / "key")
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
