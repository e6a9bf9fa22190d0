"""The kernels of a frame one by one: what is visible, its order, and lists of tiles."""

import numpy as np
import pytest

from gspure.constants import ALPHA_MIN, TILE
from gspure.opencl.binning import bands, bin_tiles, bound_entries
from gspure.opencl.engine import Engine
from gspure.opencl.frame import Frame, Traversal
from gspure.opencl.ordering import sort_by_depth
from gspure.opencl.projection import project
from gspure.opencl.sorting import prefix_sums
from gspure.opencl.storage import morton_order, store
from tests.models import AWKWARD, blobs, camera, tilted_camera
from tests.reference.footprint import extents
from tests.reference.projection import pixel_centres
from tests.reference.projection import project as project_reference

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
        self.front_to_back = storage.order[engine.read(order.positions, (order.visible,), np.uint32)]
        self.bands = bands(frame, projected, bounds, entry_budget)
        self.tiles, self.capacities = [], []
        for band in self.bands:
            lists = bin_tiles(frame, projected, bounds, band)
            columns, _ = frame.tiles
            starts = engine.read(lists.tile_starts, (len(band) * columns + 1,), np.uint32)
            positions, _ = engine.read(lists.entries, (starts[-1], 2), np.uint32).T
            self.tiles += np.split(storage.order[positions], starts[1:-1])
            self.capacities.append(lists.capacity)


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
def test_crop_keeps_the_rows_in_its_box(device, style, energy, case):
    """Kept: every Gaussian whose box holds a pixel centre. Dropped: all whose box, a little wider, holds none.

    Rays of what nearly reaches the camera plane are kept: float32 cannot tell its box.
    """
    model, view = AWKWARD[case]()
    kept = set(Lists(device, style, energy, model, view).front_to_back)
    expected = project_reference(model, view, energy)
    boxes = extents(expected)
    for slack, check in ((-1e-3, kept.issuperset), (0.05, kept.issubset)):
        low = np.maximum(np.ceil(boxes[:, :2] - slack - 0.5), 0)
        high = np.minimum(np.floor(boxes[:, 2:] + slack - 0.5), [view.width - 1, view.height - 1])
        if slack > 0 and (case, energy) == ("grazing", "ray"):
            continue
        assert check(expected.rows[(low <= high).all(axis=1)])


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
    assert len(listed) < 1.03 * len(touched)


def test_bands_split_the_image_and_keep_to_the_budget(device, style, energy):
    model, view = blobs(2000, 2, size=(0.01, 0.05)), camera(65, 97)
    whole = Lists(device, style, energy, model, view)
    assert len(whole.bands) == 1
    banded = Lists(device, style, energy, model, view, entry_budget=1500)
    assert 1 < len(banded.bands) < 7
    assert [band.start for band in banded.bands] == [0] + [band.stop for band in banded.bands[:-1]]
    assert max(banded.capacities) <= 1500
    for a, b in zip(whole.tiles, banded.tiles, strict=True):
        assert np.array_equal(a, b)
