"""Gaussians smaller than a pixel are counted, with the resolution that shows them."""

import numpy as np

from gspure.method.subpixel import subpixel_rows
from gspure.method.weights import accumulate
from gspure.renderer import Renderer
from tests.models import camera, gaussians, joined, subpixel
from tests.reference.footprint import extents
from tests.reference.projection import project


def weights_of(model, views):
    renderer = Renderer(model, energy="ray")
    return accumulate([renderer.contributions(view) for view in views], len(model))


def test_rows_smaller_than_a_pixel_in_every_view_are_found():
    model, view = subpixel()
    far = camera(focal=30.0, name="far")
    weights = weights_of(model, [view, far])
    found = subpixel_rows(model, weights, [view, far])
    boxes = extents(project(model, view, "ray"))
    areas = np.empty(len(model))
    areas[project(model, view, "ray").rows] = np.pi / 4 * (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
    assert 20 < len(found.rows) < len(model)
    assert (weights[found.rows] == 0).all()
    assert (areas[found.rows] < 1.01).all()  # of round Gaussians the box is that of a circle
    inside = (boxes[:, :2] > 0).all(axis=1) & (boxes[:, 2:] < [view.width, view.height]).all(axis=1)
    rows = project(model, view, "ray").rows[inside]
    assert set(rows[(areas[rows] < 0.99) & (weights[rows] == 0)]) <= set(found.rows)


def test_half_of_the_small_rows_cover_a_pixel_at_the_stated_magnification():
    model, view = subpixel()
    found = subpixel_rows(model, weights_of(model, [view]), [view])
    finer = view.resized(
        int(np.ceil(found.magnification * view.width)), int(np.ceil(found.magnification * view.height))
    )
    still = subpixel_rows(model, np.where(np.isin(np.arange(len(model)), found.rows), 0.0, 1.0), [finer])
    assert abs(len(still.rows) - len(found.rows) / 2) <= 0.1 * len(found.rows)
    assert str(finer.width) in found.line(len(model), view.width)


def test_invisible_gaussians_have_no_weight():
    wall = gaussians(means=[[0, 0, 1]], scales=[50.0, 50.0, 0.01], opacities=0.99)
    hidden = gaussians(means=[[0, 0, 4], [0, 0, -4], [900, 0, 4]], scales=[0.5, 1e-4, 1e-4][:1] * 3)
    faint = gaussians(means=[[0.01, 0.01, 0.5]], scales=1e-6, opacities=0.003)
    model = joined(wall, hidden, faint)
    assert subpixel_rows(model, np.array([1.0, 0, 0, 0, 0]), [camera()]) is None
