"""SecureGS: private networks over public anchors, how anchors grow, and what a short training learns."""

import numpy as np
import pytest

from gspure.evaluation.metrics import psnr
from gspure.schemes.pair import read_pair
from gspure.schemes.scheme import hide
from gspure.schemes.secure_gs import SCHEME, first_anchors
from gspure.schemes.secure_gs.growing import CELLS, GRADIENT_THRESHOLD, Candidates, grown
from tests.anchor_cases import random_key, random_public
from tests.models import camera

VIEW = camera()


def test_the_message_depends_on_no_public_offset_or_network():
    public, other, key = random_public(), random_public(seed=5), random_key()
    offsets = {name: np.zeros(40) for name in public.model.columns_named("f_offset_")}
    changed = type(public)(public.model.with_columns(offsets), other.networks)
    assert not np.allclose(changed.scene()(VIEW), public.scene()(VIEW), atol=1e-3)
    assert (key.message(changed, "message")(VIEW) == key.message(public, "message")(VIEW)).all()


def cells_of(places, side):
    return [tuple(cell) for cell in np.rint(places / np.float32(side)).astype(int).tolist()]


@pytest.mark.parametrize(("seed", "room"), [(0, 0), (1, 3), (2, 30)])
def test_at_most_one_anchor_grows_per_cell_and_growth_stops_at_the_limit(seed, room):
    rng = np.random.default_rng(seed)
    before, places = (rng.uniform(-1, 1, (count, 3)).astype(np.float32) for count in (20, 60))
    norms, thresholds = rng.exponential(1e-3, 60).astype(np.float32), np.full(60, GRADIENT_THRESHOLD, np.float32)
    new = grown(before, Candidates(places, norms, thresholds, np.ones((60, 2), np.float32)), 0.02, 4, room, rng)
    assert len(new.positions) <= room
    assert not new.offsets.any()
    for side in 0.02 * np.array(CELLS):
        cells = cells_of(new.positions[np.isclose(np.exp(new.log_scalings[:, 0]), side)], side)
        assert len({*cells}) == len(cells)
        assert not {*cells} & {*cells_of(before, side)}


@pytest.mark.parametrize("at_most", [20, 100, 5000])
def test_each_voxel_with_points_starts_with_one_anchor(at_most):
    points = np.random.default_rng(0).uniform(-1, 1, (800, 3))
    anchors, voxel = first_anchors([points], at_most)
    assert 4 <= len(anchors.positions) <= at_most
    assert len({*cells_of(anchors.positions, voxel)}) == len(anchors.positions)
    assert np.abs(points[:, None] - anchors.positions).max(axis=2).min(axis=1).max() <= voxel / 2 + 1e-6


SHORT = {"iterations": 120, "max_anchors": 600}


@pytest.fixture(scope="module")
def pair(pair_folder):
    pytest.importorskip("torch")
    return read_pair(pair_folder)


def quality(view, capture):
    return np.mean([psnr(view(c).clip(0, 1), photo) for c, photo in zip(capture.views, capture.images, strict=True)])


def mean_colour(photographs):
    mean = np.mean(photographs, axis=(0, 1, 2))
    return np.mean([psnr(np.broadcast_to(mean, photo.shape), photo) for photo in photographs])


def test_scene_and_message_are_learned_over_the_same_anchors(pair):
    public, key = hide(SCHEME, pair, seed=3, **SHORT)
    scene, message = public.scene(), key.message(public, "message")
    assert quality(scene, pair.scene) > mean_colour(pair.scene.images) + 2
    assert quality(message, pair.message) > mean_colour(pair.message.images) + 2
    wrong = key.wrong(np.random.default_rng(0)).message(public, "message")
    assert quality(wrong, pair.message) < quality(message, pair.message) - 2
