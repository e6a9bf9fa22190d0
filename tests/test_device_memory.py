"""How much memory of a device the renderer takes."""

from types import SimpleNamespace

import numpy as np
import pyopencl as cl
import pytest

from gspure.constants import TILE
from gspure.errors import InputError
from gspure.model.gaussians import Gaussians
from gspure.opencl.blending import _batch
from gspure.opencl.engine import Engine, Program
from gspure.opencl.frame import Traversal
from gspure.opencl.storage import BLOCK, blocked_shape, store, upload_attributes, upload_sh_coeffs
from tests.models import blobs


@pytest.mark.parametrize(("count", "blocks"), [(0, 1), (1, 1), (BLOCK, 1), (BLOCK + 1, 2), (10 * BLOCK, 10)])
def test_only_the_last_block_of_gaussians_is_padded(count, blocks):
    assert blocked_shape(count, 11) == (blocks, 11, BLOCK)


def test_attributes_lie_in_storage_order_in_blocks_padded_with_zeros(device):
    values = np.random.default_rng(0).normal(size=(BLOCK + 3, 2)).astype(np.float32)
    order, engine = np.arange(len(values), dtype=np.uint32)[::-1].copy(), Engine(device.cl_device)
    buffer = upload_attributes(engine, order, 2, lambda rows: values[rows])
    positions = engine.read(buffer, blocked_shape(len(values), 2), np.float32).swapaxes(1, 2).reshape(-1, 2)
    assert np.array_equal(positions[: len(values)], values[::-1])
    assert not positions[len(values) :].any()


def test_each_part_of_a_model_leaves_memory_once_it_is_uploaded(device, monkeypatch):
    released = []
    monkeypatch.setattr(Gaussians, "release_pages", lambda model: released.append(id(model)))
    monkeypatch.setattr("gspure.opencl.storage._CHUNK", 16)
    engine, model = Engine(device.cl_device), blobs(40)
    storage = store(engine, model)
    assert released == [id(model)] * 3
    upload_sh_coeffs(engine, storage, model)
    assert released == [id(model)] * 6


def test_memory_that_is_mapped_to_be_read_is_not_written(device):
    """On some devices, what is written would be lost."""
    engine = Engine(device.cl_device)
    buffer = engine.uploaded(np.zeros(16, np.uint32))
    with engine.mapped(buffer, (16,), np.uint32) as words, pytest.raises(ValueError, match="read-only"):
        words[0] = 1


@pytest.mark.parametrize("code", ["MEM_OBJECT_ALLOCATION_FAILURE", "OUT_OF_RESOURCES", "OUT_OF_HOST_MEMORY"])
def test_a_driver_that_lacks_memory_only_when_a_kernel_starts_is_reported(device, monkeypatch, code):
    def fails(*_):
        raise cl.MemoryError(cl._cl._ErrorRecord("", getattr(cl.status_code, code), "clEnqueueNDRangeKernel"))

    engine = Engine(device.cl_device)
    program = Program({"fails": fails}, engine.queue, 1)
    with pytest.raises(InputError, match=f"memory: expected room for all buffers at once, found .*{code}"):
        program.launch("fails", 1)


@pytest.mark.parametrize("contributions", [False, True])
@pytest.mark.parametrize("channels", [0, 3, 17, 300])
@pytest.mark.parametrize("kib", [2, 7, 16, 48, 64, 1024])
def test_a_work_group_stages_as_many_splats_as_three_quarters_of_local_memory_hold(kib, channels, contributions):
    traversal = Traversal("ewa", channels=channels, contributions=contributions)
    device = SimpleNamespace(local_mem_size=kib << 10)
    batch = _batch(SimpleNamespace(engine=SimpleNamespace(device=device), traversal=traversal))
    floats = 7 + channels + (3 if contributions else 0)
    assert 4 * floats * batch <= 0.75 * device.local_mem_size
    assert batch == TILE * TILE or 2 * 4 * floats * batch > 0.75 * device.local_mem_size
