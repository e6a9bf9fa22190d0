"""How much memory of a device the renderer takes."""

from types import SimpleNamespace

import pytest

from gspure.constants import TILE
from gspure.opencl.blending import _batch
from gspure.opencl.frame import Traversal
from gspure.opencl.storage import BLOCK, blocked_shape


@pytest.mark.parametrize(("count", "blocks"), [(0, 1), (1, 1), (BLOCK, 1), (BLOCK + 1, 2), (10 * BLOCK, 10)])
def test_only_the_last_block_of_gaussians_is_padded(count, blocks):
    assert blocked_shape(count, 11) == (blocks, 11, BLOCK)


@pytest.mark.parametrize("contributions", [False, True])
@pytest.mark.parametrize("channels", [0, 3, 17])
@pytest.mark.parametrize("kib", [2, 16, 48, 64, 1024])
def test_a_work_group_stages_as_many_splats_as_three_quarters_of_local_memory_hold(kib, channels, contributions):
    traversal = Traversal("ewa", channels=channels, contributions=contributions)
    device = SimpleNamespace(local_mem_size=kib << 10)
    batch = _batch(SimpleNamespace(engine=SimpleNamespace(device=device), traversal=traversal))
    floats = 7 + channels + (3 if contributions else 0)
    assert 4 * floats * batch <= 0.75 * device.local_mem_size
    assert batch == TILE * TILE or 2 * 4 * floats * batch > 0.75 * device.local_mem_size
