"""Projection: splat records and culling against the reference."""

import numpy as np
import pytest

from gspure.opencl.engine import Engine
from gspure.opencl.frame import Pass
from gspure.opencl.ordering import sort_by_depth
from gspure.opencl.projection import project
from gspure.opencl.storage import store
from gspure.reference.footprint import extents
from gspure.reference.projection import project as project_reference
from tests.models import AWKWARD, blobs, tilted_camera

U, V, LOG2_OPACITY, DEPTH = 0, 1, 5, 6  # layout.cl


def projected(device, style, energy, model, view):
    """(visible rows front to back, their splats)."""
    engine = Engine(device.cl_device, style)
    storage, frame = store(engine, model), Pass(energy)
    buffers = project(engine, frame, view, storage, None)
    order = sort_by_depth(engine, buffers, storage)
    positions = engine.read(order.positions, (order.visible,), np.uint32)
    splats = engine.read(buffers.splats, (len(model), frame.splat_floats), np.float32)
    return storage.order[positions], splats[positions]


def test_splats_hold_centre_depth_and_opacity(device, style, energy):
    model, view = blobs(100, 1), tilted_camera()
    rows, splats = projected(device, style, energy, model, view)
    expected = project_reference(model, view, energy)
    place = {row: i for i, row in enumerate(expected.rows)}
    at = [place[row] for row in rows]
    assert len(rows) > 50
    np.testing.assert_allclose(splats[:, [U, V]], expected.means2d[at], atol=1e-4)
    np.testing.assert_allclose(splats[:, DEPTH], expected.depths[at], rtol=1e-6)
    np.testing.assert_allclose(np.exp2(splats[:, LOG2_OPACITY]), expected.opacities[at], rtol=2e-6)
    assert (np.diff(splats[:, DEPTH]) >= 0).all()


@pytest.mark.parametrize("case", AWKWARD)
def test_what_is_kept_is_what_its_box_says(device, style, energy, case):
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
