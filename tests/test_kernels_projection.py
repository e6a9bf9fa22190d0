"""Projection: splat records and culling against the reference."""

import numpy as np
import pytest

from gspure.opencl.engine import Engine
from gspure.opencl.frame import Frame, Traversal
from gspure.opencl.ordering import sort_by_depth
from gspure.opencl.projection import project
from gspure.opencl.storage import store
from tests.models import AWKWARD, blobs, tilted_camera
from tests.reference.footprint import extents
from tests.reference.projection import project as project_reference

U, V, LOG2_OPACITY, DEPTH, L0, A0, C0 = 0, 1, 5, 6, 9, 10, 11  # layout.cl


def projected(device, style, energy, model, view):
    """(visible rows front to back, their splats)."""
    engine = Engine(device.cl_device, style)
    storage = store(engine, model)
    frame = Frame(engine, storage, view, Traversal(energy))
    buffers = project(frame)
    order = sort_by_depth(engine, storage, buffers.depth_keys)
    positions = engine.read(order.positions, (order.visible,), np.uint32)
    splats = engine.read(buffers.splats, (len(model), frame.traversal.splat_floats), np.float32)
    return storage.order[positions], splats[positions]


def test_splats_hold_centre_depth_and_opacity(device, style):
    model, view = blobs(100, 1), tilted_camera()
    rows, splats = projected(device, style, "ewa", model, view)
    expected = project_reference(model, view, "ewa")
    at = [list(expected.rows).index(row) for row in rows]
    assert len(rows) > 50
    np.testing.assert_allclose(splats[:, [U, V]], expected.means2d[at], atol=1e-4)
    np.testing.assert_allclose(splats[:, DEPTH], expected.depths[at], rtol=1e-6)
    np.testing.assert_allclose(np.exp2(splats[:, LOG2_OPACITY]), expected.opacities[at], rtol=2e-6)
    assert (np.diff(splats[:, DEPTH]) >= 0).all()


def test_offsets_of_rays_start_at_the_centre_or_at_the_nearest_point_of_the_image(device, style):
    model, view = blobs(100, 1), tilted_camera()
    rows, splats = projected(device, style, "ray", model, view)
    expected = project_reference(model, view, "ray")
    at = [list(expected.rows).index(row) for row in rows]
    nearest = np.clip(expected.means2d[at], 0, [view.width, view.height])
    np.testing.assert_allclose(splats[:, [U, V]], nearest, atol=1e-4)
    inside = (nearest == expected.means2d[at]).all(axis=1)
    assert 10 < np.count_nonzero(inside) < len(rows) - 10
    np.testing.assert_allclose(1 / splats[inside, L0], expected.depths[at][inside], rtol=1e-6)
    assert (splats[inside][:, [A0, C0]] == 0).all()
    for i in np.flatnonzero(~inside):  # there, energy and depth are those of the offset 0
        _, depth = expected.evaluate(at[i], *nearest[i])
        assert splats[i, L0] / (splats[i, L0] ** 2 + splats[i, A0] ** 2 + splats[i, C0] ** 2) == pytest.approx(depth)


@pytest.mark.parametrize("case", AWKWARD)
def test_crop_keeps_the_rows_in_its_box(device, style, energy, case):
    """Kept: every Gaussian whose box holds a pixel centre. Dropped: all whose box, a little wider, holds none.

    Rays of what nearly reaches the camera plane are kept: float32 cannot tell its box.
    """
    model, view = AWKWARD[case]()
    kept = set(projected(device, style, energy, model, view)[0])
    expected = project_reference(model, view, energy)
    boxes = extents(expected)
    for slack, check in ((-1e-3, kept.issuperset), (0.05, kept.issubset)):
        low = np.maximum(np.ceil(boxes[:, :2] - slack - 0.5), 0)
        high = np.minimum(np.floor(boxes[:, 2:] + slack - 0.5), [view.width - 1, view.height - 1])
        if slack > 0 and (case, energy) == ("grazing", "ray"):
            continue
        assert check(expected.rows[(low <= high).all(axis=1)])
