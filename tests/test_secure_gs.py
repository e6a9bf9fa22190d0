"""SecureGS: private networks over public anchors, how anchors grow, and the scheme without torch."""

import numpy as np
import pytest

from gspure.schemes.secure_gs import first_anchors
from gspure.schemes.secure_gs.anchors import Anchors
from gspure.schemes.secure_gs.growing import (
    CELLS,
    GRADIENT_THRESHOLD,
    Candidates,
    grown,
)
from tests.anchor_cases import random_key, random_public
from tests.models import camera

VIEW = camera()


def test_the_message_depends_on_no_public_offset_or_network():
    public, other, key = random_public(), random_public(seed=5), random_key()
    offsets = {name: np.zeros(40) for name in public.model.columns_named("f_offset_")}
    changed = type(public)(public.model.with_columns(offsets), other.networks)
    assert not np.allclose(changed.scene()(VIEW), public.scene()(VIEW), atol=1e-3)
    assert (key.message(changed, "message")(VIEW) == key.message(public, "message")(VIEW)).all()


def candidates(places, norms, thresholds=GRADIENT_THRESHOLD, feat_dim=2):
    places = np.asarray(places, np.float32)
    features = np.arange(len(places) * feat_dim, dtype=np.float32).reshape(-1, feat_dim)
    return Candidates(
        places,
        np.broadcast_to(np.asarray(norms, np.float32), len(places)),
        np.broadcast_to(np.asarray(thresholds, np.float32), len(places)),
        features,
    )


def cells_of(anchors: Anchors, side):
    return {tuple(cell) for cell in np.rint(anchors.positions / np.float32(side)).astype(int).tolist()}


@pytest.mark.parametrize(("seed", "room"), [(0, 0), (1, 3), (2, 30)])
def test_at_most_one_anchor_grows_per_cell_and_growth_stops_at_the_limit(seed, room):
    rng = np.random.default_rng(seed)
    before = rng.uniform(-1, 1, (20, 3)).astype(np.float32)
    asking = candidates(rng.uniform(-1, 1, (60, 3)), rng.exponential(1e-3, 60))
    new = grown(before, asking, 0.02, 4, room, rng)
    assert len(new.positions) <= room
    sides = np.exp(new.log_scalings[:, 0])
    assert not new.offsets.any()
    for cell in CELLS:
        level = np.isclose(sides, 0.02 * cell)
        grid = np.rint(new.positions[level] / np.float32(0.02 * cell)).astype(int)
        assert len(np.unique(grid, axis=0)) == level.sum()
        old = np.rint(before / np.float32(0.02 * cell)).astype(int)
        assert not {*map(tuple, grid.tolist())} & {*map(tuple, old.tolist())}


@pytest.mark.parametrize("at_most", [20, 100, 5000])
def test_each_voxel_with_points_starts_with_one_anchor(at_most):
    points = np.random.default_rng(0).uniform(-1, 1, (800, 3))
    anchors, voxel = first_anchors([points], at_most)
    assert 4 <= len(anchors.positions) <= at_most
    assert len(cells_of(anchors, voxel)) == len(anchors.positions)
    assert np.abs(points[:, None] - anchors.positions).max(axis=2).min(axis=1).max() <= voxel / 2 + 1e-6
