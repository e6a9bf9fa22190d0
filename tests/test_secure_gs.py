"""SecureGS: the Gaussians of a view, the growth of anchors, and a short training."""

import numpy as np
import pytest
from scipy.special import expit

from gspure_torch.secure_gs.anchors import neural, visible_rows
from gspure_torch.secure_gs.growing import CELLS, GRADIENT_THRESHOLD, Candidates, grown
from gspure_torch.secure_gs.initialization import first_anchors
from tests.anchor_cases import random_key, random_public
from tests.models import blobs, camera, tilted_camera
from tests.reference.projection import Splats, project

VIEW = camera()
VIEWS = (VIEW, tilted_camera())


def by_hand(public, view, row, i):
    """One Gaussian of one anchor, number by number: Scaffold-GS's formulas in float64."""
    anchors = public.anchors
    away = anchors.positions[row].astype(np.float64) - view.centre
    direction = away / np.linalg.norm(away)
    feature = anchors.features[row].astype(np.float64)

    def outputs(name, inputs):
        net = public.networks[name]
        return net["2.weight"] @ np.maximum(net["0.weight"] @ inputs + net["0.bias"], 0) + net["2.bias"]

    inputs = np.concatenate([feature, direction])
    shape = outputs("cov", inputs)[7 * i : 7 * i + 7]
    scalings = np.exp(anchors.log_scalings[row].astype(np.float64))
    return {
        "opacities": np.tanh(outputs("opacity", inputs)[i]),
        "means": anchors.positions[row] + anchors.offsets[row, i] * scalings[:3],
        "scales": scalings[3:] * expit(shape[:3]),
        "quats": shape[3:] / np.linalg.norm(shape[3:]),
        "colors": expit(outputs("color", inputs)[3 * i : 3 * i + 3]),
    }


def test_neural_gaussians_are_those_of_the_formulas():
    public = random_public()
    view = tilted_camera()
    gaussians, rows = public.neural(view)
    active = set()
    for place in range(len(rows) * 4):
        expected = by_hand(public, view, rows[place // 4], place % 4)
        if expected["opacities"] > 0:
            active.add(place)
            index = np.searchsorted(gaussians.active, place)
            for name, value in expected.items():
                np.testing.assert_allclose(getattr(gaussians, name)[index], value, rtol=2e-4, atol=2e-6)
    assert active == set(gaussians.active.tolist())
    assert 0 < len(active) < 4 * len(rows)


@pytest.mark.parametrize("view", VIEWS, ids=["straight", "tilted"])
def test_a_view_has_the_anchors_whose_squares_reach_its_tiles(view):
    """The rule of the rasterizer, from the reference's splats."""
    model = blobs(400, 5, size=(0.01, 0.6))
    model = model.with_columns({"x": model.means[:, 0] * 2, "z": model.means[:, 2] - 3.5})
    splats = project(model, view, "ewa")
    assert isinstance(splats, Splats)
    expected = []
    for row, centre, cov in zip(splats.rows, splats.means2d - 0.5, splats.covs2d, strict=True):
        half = (cov[0, 0] + cov[1, 1]) / 2
        radius = np.ceil(3 * np.sqrt(half + np.sqrt(max(0.1, half**2 - np.linalg.det(cov)))))
        tiles = (-(-view.width // 16), -(-view.height // 16))
        first = np.clip([int((c - radius) / 16) for c in centre], 0, tiles)
        last = np.clip([int((c + radius + 15) / 16) for c in centre], 0, tiles)
        if (last > first).all():
            expected.append(row)
    rows = visible_rows(view, model.means, model.quats, model.scales)
    assert rows.tolist() == sorted(expected)
    assert 20 < len(rows) < 380


def test_numpy_and_torch_make_the_same_gaussians():
    torch = pytest.importorskip("torch")
    public = random_public()
    anchors = public.anchors
    centre = tilted_camera().centre.astype(np.float32)
    by_numpy = neural(np, anchors, public.networks, centre)
    networks = {n: {p: torch.from_numpy(a) for p, a in net.items()} for n, net in public.networks.items()}
    tensors = type(anchors)(*map(torch.from_numpy, vars(anchors).values()))
    by_torch = neural(torch, tensors, networks, torch.from_numpy(centre))
    assert by_numpy.active.tolist() == by_torch.active.tolist()
    for name in ("means", "quats", "scales", "opacities", "colors", "outputs"):
        np.testing.assert_allclose(getattr(by_numpy, name), getattr(by_torch, name).numpy(), rtol=1e-4, atol=1e-6)


def test_the_message_depends_on_no_public_offset_or_network():
    public = random_public()
    key = random_key()
    offsets = {name: np.zeros(40) for name in public.model.columns_named("f_offset_")}
    changed = type(public)(public.model.with_columns(offsets), random_public(seed=5).networks)
    assert not np.allclose(changed.scene()(VIEW), public.scene()(VIEW), atol=1e-3)
    assert (key.message(changed, "message")(VIEW) == key.message(public, "message")(VIEW)).all()


def cells_of(places, side):
    return [tuple(cell) for cell in np.rint(places / np.float32(side)).astype(int).tolist()]


@pytest.mark.parametrize(("seed", "room"), [(0, 0), (1, 3), (2, 30)])
def test_at_most_one_anchor_grows_per_cell_and_growth_stops_at_the_limit(seed, room):
    rng = np.random.default_rng(seed)
    before = rng.uniform(-1, 1, (20, 3)).astype(np.float32)
    candidates = Candidates(
        positions=rng.uniform(-1, 1, (60, 3)).astype(np.float32),
        norms=rng.exponential(1e-3, 60).astype(np.float32),
        thresholds=np.full(60, GRADIENT_THRESHOLD, np.float32),
        features=np.ones((60, 2), np.float32),
    )
    new = grown(before, candidates, 0.02, 4, room, rng)
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
