"""Scaffold-GS models: what a view makes of anchors and networks, measured and pruned by anchor."""

import numpy as np
import pytest

from gspure.schemes.secure_gs.anchors import neural, visible_rows
from tests.anchor_cases import random_public
from tests.models import blobs, camera, tilted_camera, without
from tests.reference.projection import Splats, project

VIEWS = (camera(), tilted_camera())


def sigmoid(x):
    return 1 / (1 + np.exp(-np.asarray(x, np.float64)))


def by_hand(public, view, row, i):
    """One Gaussian of one anchor, number by number: Scaffold-GS's formulas in float64."""
    anchors, networks = public.anchors, public.networks
    away = anchors.positions[row].astype(np.float64) - view.centre
    direction = away / np.linalg.norm(away)
    feature = anchors.features[row].astype(np.float64)

    def outputs(name, inputs):
        net = networks[name]
        return net["2.weight"] @ np.maximum(net["0.weight"] @ inputs + net["0.bias"], 0) + net["2.bias"]

    inputs = np.concatenate([feature, direction])
    shape = outputs("cov", inputs)[7 * i : 7 * i + 7]
    scalings = np.exp(anchors.log_scalings[row].astype(np.float64))
    return {
        "opacities": np.tanh(outputs("opacity", inputs)[i]),
        "means": anchors.positions[row] + anchors.offsets[row, i] * scalings[:3],
        "scales": scalings[3:] * sigmoid(shape[:3]),
        "quats": shape[3:] / np.linalg.norm(shape[3:]),
        "colors": sigmoid(outputs("color", inputs)[3 * i : 3 * i + 3]),
    }


def test_neural_gaussians_are_those_of_the_formulas():
    public, view = random_public(), tilted_camera()
    found, rows = public.neural(view)
    active = set()
    for place in range(len(rows) * 4):
        expected = by_hand(public, view, rows[place // 4], place % 4)
        if expected["opacities"] > 0:
            active.add(place)
            at = np.searchsorted(found.active, place)
            for name, value in expected.items():
                np.testing.assert_allclose(getattr(found, name)[at], value, rtol=2e-4, atol=2e-6)
    assert active == set(found.active.tolist())
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
        columns, lines = -(-view.width // 16), -(-view.height // 16)
        first = np.clip([int((c - radius) / 16) for c in centre], 0, (columns, lines))
        last = np.clip([int((c + radius + 15) / 16) for c in centre], 0, (columns, lines))
        if (last > first).all():
            expected.append(row)
    found = visible_rows(view, model.means, model.quats, model.scales)
    assert found.tolist() == sorted(expected)
    assert 20 < len(found) < 380


def test_pruning_anchors_removes_exactly_their_gaussians():
    public, view = random_public(), VIEWS[1]
    pruned = np.random.default_rng(1).random(40) < 0.4
    whole, rows = public.gaussians(view)
    left, owners = without(public, pruned).gaussians(view)
    assert np.flatnonzero(~pruned)[owners].tolist() == rows[~pruned[rows]].tolist()
    names = whole.table.dtype.names
    np.testing.assert_allclose(left.columns(*names), whole[~pruned[rows]].columns(*names), rtol=1e-4, atol=1e-5)


def test_numpy_and_torch_make_the_same_gaussians():
    torch = pytest.importorskip("torch")
    public = random_public()
    anchors, view = public.anchors, tilted_camera()
    networks = {n: {p: torch.from_numpy(a) for p, a in net.items()} for n, net in public.networks.items()}
    tensors = type(anchors)(*map(torch.from_numpy, vars(anchors).values()))
    centre = view.centre.astype(np.float32)
    here, there = (
        neural(np, anchors, public.networks, centre),
        neural(torch, tensors, networks, torch.from_numpy(centre)),
    )
    assert here.active.tolist() == there.active.tolist()
    for name in ("means", "quats", "scales", "opacities", "colors", "outputs"):
        np.testing.assert_allclose(getattr(here, name), getattr(there, name).numpy(), rtol=1e-4, atol=1e-6)
