"""Tile lists against brute force over pixel centres."""

import numpy as np
import pytest

from gspure.constants import ALPHA_MIN, TILE
from gspure.opencl.binning import bands, bin_tiles, bound_entries
from gspure.opencl.engine import Engine
from gspure.opencl.frame import Frame, Traversal
from gspure.opencl.ordering import sort_by_depth
from gspure.opencl.projection import project
from gspure.opencl.storage import store
from tests.models import AWKWARD, blobs, camera, gaussians, tilted_camera
from tests.reference.projection import pixel_centres
from tests.reference.projection import project as project_reference


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
    model, view = blobs(120, 2), camera(65, 97)
    whole = Lists(device, style, energy, model, view)
    assert len(whole.bands) == 1
    banded = Lists(device, style, energy, model, view, entry_budget=150)
    assert 1 < len(banded.bands) < 7
    assert [band.start for band in banded.bands] == [0] + [band.stop for band in banded.bands[:-1]]
    assert max(banded.capacities) <= 150
    for a, b in zip(whole.tiles, banded.tiles, strict=True):
        assert np.array_equal(a, b)


def test_bands_are_as_tall_as_the_budget_allows(device, style, energy):
    """Of 4x3 tiles, one Gaussian covers all, and one lies in the fourth: 5, 4 and 4 entries in the rows of tiles."""
    view = camera(4 * TILE, 3 * TILE)
    pixel = 4 / view.K[0, 0]
    model = gaussians(means=[[0, 0, 4], [1.5 * TILE * pixel, -TILE * pixel, 4]], scales=[[9.0], [0.01]])
    heights = {13: [3], 12: [2, 1], 9: [2, 1], 8: [1, 2], 7: [1, 1, 1], 1: [1, 1, 1]}
    for budget, expected in heights.items():
        lists = Lists(device, style, energy, model, view, entry_budget=budget)
        assert [len(band) for band in lists.bands] == expected
