"""Depth order: the radix sort against numpy's."""

import numpy as np
import pytest

from gspure.opencl.counting import prefix_sums
from gspure.opencl.engine import Engine
from gspure.opencl.ordering import sort_by_depth
from gspure.opencl.storage import morton_order, store
from tests.models import blobs

NOT_VISIBLE = 0xFFFFFFFF


def sorted_rows(device, style, keys_by_row):
    """The rows that `sort_by_depth` leaves, front to back."""
    engine = Engine(device.cl_device, style)
    storage = store(engine, blobs(len(keys_by_row), 1, sh_degree=0))
    order = sort_by_depth(engine, storage, engine.uploaded(keys_by_row[storage.order]))
    return storage.order[engine.read(order.positions, (order.visible,), np.uint32)]


@pytest.mark.parametrize("count", [1, 16, 17, 1000, 2048, 2049, 20_000])
@pytest.mark.parametrize("distinct", [1, 7, 2**31])
def test_visible_rows_come_front_to_back_and_equal_depths_in_row_order(device, style, count, distinct):
    rng = np.random.default_rng(count)
    keys = np.float32(0.2 + rng.integers(0, distinct, count) * 1e-4).view(np.uint32)
    keys[rng.random(count) < 0.3] = NOT_VISIBLE
    visible = np.flatnonzero(keys != NOT_VISIBLE)
    expected = visible[np.argsort(keys[visible], kind="stable")]
    assert np.array_equal(sorted_rows(device, style, keys), expected)


def test_any_byte_of_a_key_changes_the_digest(device, style):
    keys = np.random.default_rng(0).integers(0, NOT_VISIBLE, 5000, dtype=np.uint32)
    assert np.array_equal(sorted_rows(device, style, keys), np.argsort(keys, kind="stable"))


def test_a_view_without_gaussians_has_an_empty_depth_order(device, style):
    assert sorted_rows(device, style, np.full(40, NOT_VISIBLE, np.uint32)).size == 0


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
    means = np.zeros((100, 3), np.float32)
    means[3:6] = [[1e30, 0, 0], [np.nan, 1, 0], [np.inf, -np.inf, 0]]
    assert np.array_equal(np.sort(morton_order(means)), np.arange(100))
    assert morton_order(means[:0]).size == 0
