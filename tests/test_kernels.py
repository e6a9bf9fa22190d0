"""The kernels of a frame one by one: exp2, projection, order and lists of tiles."""

import numpy as np
import pyopencl as cl
import pytest

from gspure.constants import ALPHA_MIN, TILE
from gspure.opencl.binning import bands, bin_tiles, bound_entries
from gspure.opencl.engine import Engine, Program, by_name
from gspure.opencl.frame import Frame, Traversal
from gspure.opencl.ordering import sort_by_depth
from gspure.opencl.program import build_options, kernel_source
from gspure.opencl.projection import camera_numbers, project
from gspure.opencl.sorting import GROUP, prefix_sums
from gspure.opencl.storage import morton_order, store
from tests.models import AWKWARD, blobs, camera, tilted_camera
from tests.reference.footprint import extents
from tests.reference.projection import pixel_centres
from tests.reference.projection import project as project_reference

EVALUATE = """
__kernel void evaluate(__global const V *x, __global V *y) {
    y[get_global_id(0)] = exp2_polynomial(x[get_global_id(0)]);
}
"""


def test_exp2_is_within_four_ten_millionths(device, style):
    engine, lanes = Engine(device.cl_device, style), {"cpu": 16, "gpu": 1}[style]
    x = np.linspace(-126, 127, 1 << 14).astype(np.float32)
    source = kernel_source("vector") + EVALUATE
    program = cl.Program(engine.context, source).build(options=build_options({"LANES": lanes}))
    result = engine.allocate(x.nbytes)
    Program(by_name(program), engine.queue, 1).launch("evaluate", x.size // lanes, engine.uploaded(x), result)
    np.testing.assert_allclose(engine.read(result, x.shape, np.float32), np.exp2(x.astype(np.float64)), rtol=4e-7)


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


@pytest.mark.parametrize(("x", "is_origin"), [(0.0, False), (-10.0, False), (-10.5, True), (5e5, True)])
def test_a_camera_with_a_coordinate_beyond_ten_is_the_origin_of_its_frame(x, is_origin):
    centre, point, viewmat = np.array([x, 0.5, -2]), np.array([x, 4, 3]), np.eye(4)[[1, 2, 0, 3]]
    viewmat[:3, 3] = -viewmat[:3, :3] @ centre
    numbers = camera_numbers(camera(viewmat=viewmat))
    view, origin = numbers[6:18].reshape(3, 4), numbers[21:]
    assert origin.tolist() == (centre * is_origin).tolist()
    assert (numbers[18:21] + origin).tolist() == centre.tolist()
    assert (view[:, :3] @ (point - origin) + view[:, 3]).tolist() == [3.5, 5, 0]


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


NOT_VISIBLE = 0xFFFFFFFF


def sorted_rows(device, style, keys_by_row):
    """The rows that `sort_by_depth` leaves, front to back."""
    engine = Engine(device.cl_device, style)
    storage = store(engine, blobs(len(keys_by_row), 1, sh_degree=0))
    order = sort_by_depth(engine, storage, engine.uploaded(keys_by_row[storage.order]))
    return storage.order[engine.read(order.positions, (order.visible,), np.uint32)]


@pytest.mark.parametrize("count", [1, 16, 17, 1000, 2048, 2049, 20_000])
@pytest.mark.parametrize("distinct", [1, 7, NOT_VISIBLE])
def test_visible_rows_come_front_to_back_and_equal_depths_in_row_order(device, style, count, distinct):
    rng = np.random.default_rng(count)
    keys = rng.integers(0, distinct, count, np.uint32)
    keys[rng.random(count) < 0.3] = NOT_VISIBLE
    visible = np.flatnonzero(keys != NOT_VISIBLE)
    expected = visible[np.argsort(keys[visible], kind="stable")]
    assert np.array_equal(sorted_rows(device, style, keys), expected)


def test_a_total_beyond_32_bits_is_exact(device):
    """Bounds of tile entries may add up to more than a band can hold: then the frame is split."""
    engine = Engine(device.cl_device)
    counts = engine.uploaded(np.full(4, 2**31, np.uint32))
    assert prefix_sums(engine, counts, 4, engine.buffers.chunk_starts)[1] == 2**33


def test_the_storage_order_holds_every_row_once_and_keeps_neighbours_together():
    means = blobs(4000, 2, sh_degree=0).means
    order = morton_order(means)
    assert np.array_equal(np.sort(order), np.arange(4000))
    steps = np.linalg.norm(np.diff(means[order], axis=0), axis=1)
    assert np.median(steps) < np.median(np.linalg.norm(np.diff(means, axis=0), axis=1)) / 5


def test_the_storage_order_is_that_of_interleaved_coordinates():
    """A tenth of the means lies at either end of each axis, so the cells of the curve are 1 wide."""
    rng = np.random.default_rng(0)
    means = (rng.integers(0, 8, (2000, 3)) << rng.integers(0, 8, (2000, 1))).astype(np.float32)
    means[:200], means[200:400], means[1200:] = 0, 1024, 1023 - means[1200:]
    cells = np.minimum(means, 1023).astype(int)
    codes = sum((cells[:, axis] >> bit & 1) << 3 * bit + axis for bit in range(10) for axis in range(3))
    assert np.array_equal(morton_order(means), np.argsort(codes, kind="stable"))


def test_the_storage_order_survives_means_that_are_equal_far_or_not_finite():
    means = np.zeros((300, 3), np.float32)
    means[3:6] = [[1e30, 0, 0], [np.nan, 1, 0], [np.inf, -np.inf, 0]]
    assert morton_order(means).tolist() == [*range(3), *range(5, 300), 3, 4]  # what is not finite counts as 0
    assert morton_order(means[:0]).size == 0


class Lists:
    """The lists of a whole frame, read back: rows of each tile, front to back."""

    def __init__(self, device, style, energy, model, view, entry_budget=1 << 20):
        engine = Engine(device.cl_device, style)
        storage = store(engine, model)
        frame = Frame(engine, storage, view, Traversal(energy))
        projected = project(frame)
        order = sort_by_depth(engine, storage, projected.depth_keys)
        bounds = bound_entries(frame, projected, order)
        self.bounds = bounds.chunks
        self.front_to_back = storage.order[engine.read(order.positions, (order.visible,), np.uint32)]
        self.bands = bands(frame, projected, bounds, entry_budget)
        self.tiles, self.capacities = [], []
        for band in self.bands:
            lists = bin_tiles(frame, projected, bounds, band)
            columns, _ = frame.tiles
            starts = engine.read(lists.tile_starts, (len(band) * columns + 1,), np.uint32)
            positions, slots = engine.read(lists.entries, (starts[-1], 2), np.uint32).T
            rows = storage.order[positions]
            ranges = engine.read(lists.slot_ranges, (order.visible, 2), np.uint32)
            self.tiles += np.split(rows, starts[1:-1])
            self.capacities.append(lists.capacity)
            check_slots(self.front_to_back, rows, slots, ranges, lists.capacity)


def check_slots(front_to_back, rows, slots, ranges, capacity):
    """Each entry has a slot of its own, among its Gaussian's, and those of one Gaussian are in tile order."""
    assert len(np.unique(slots)) == len(slots)
    assert (slots < capacity).all()
    for row, (begin, end) in zip(front_to_back, ranges, strict=True):
        assert np.array_equal(slots[rows == row], np.arange(begin, end))


def pairs(lists):
    """{(tile, row)} of all entries."""
    return {(tile, row) for tile, rows in enumerate(lists.tiles) for row in rows}


def touched_pairs(model, view, energy):
    """{(tile, row)} of all Gaussians and tiles with a pixel centre of alpha >= 1/255."""
    projection = project_reference(model, view, energy)
    u, v = pixel_centres(view)
    touched, columns = set(), -(-view.width // TILE)
    for i, row in enumerate(projection.rows):
        y, x = np.nonzero(projection.opacities[i] * projection.evaluate(i, u, v)[0] >= ALPHA_MIN)
        touched |= {(tile, row) for tile in np.unique(y // TILE * columns + x // TILE)}
    return touched


@pytest.mark.parametrize("case", AWKWARD)
def test_lists_hold_every_touched_gaussian_once_and_front_to_back(device, style, energy, case):
    model, view = AWKWARD[case]()
    lists = Lists(device, style, energy, model, view)
    rank = {row: i for i, row in enumerate(lists.front_to_back)}
    for rows in lists.tiles:
        assert (np.diff([rank[row] for row in rows]) > 0).all()
    assert pairs(lists) >= touched_pairs(model, view, energy)


def test_tile_lists_hold_few_untouched_gaussians(device, style, energy):
    """A Gaussian's ellipse may pass between pixel centres, and nothing more."""
    model, view = blobs(300, 1, size=(0.05, 0.5)), tilted_camera(160, 120, focal=150)
    listed, touched = pairs(Lists(device, style, energy, model, view)), touched_pairs(model, view, energy)
    assert listed >= touched
    assert len(listed) < 1.03 * len(touched)


def test_bands_split_the_image_and_keep_to_the_budget(device, style, energy):
    model, view = blobs(2000, 2, size=(0.01, 0.05)), camera(65, 97)
    whole = Lists(device, style, energy, model, view)
    assert len(whole.bands) == 1
    assert whole.bounds == (-(-len(whole.front_to_back) // GROUP) if style == "gpu" else 1)
    banded = Lists(device, style, energy, model, view, entry_budget=1500)
    assert 1 < len(banded.bands) < 7
    assert [band.start for band in banded.bands] == [0] + [band.stop for band in banded.bands[:-1]]
    assert max(banded.capacities) <= 1500
    for a, b in zip(whole.tiles, banded.tiles, strict=True):
        assert np.array_equal(a, b)
