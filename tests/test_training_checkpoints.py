"""Checkpoints: written whole, read only by the run that wrote them."""

import numpy as np
import pytest

from gspure.errors import InputError
from gspure.training.checkpoints import Snapshot, read_checkpoint, write_checkpoint
from tests.training_cases import same_bits, state

SETTINGS = {"iterations": 100, "seed": 3, "background": (0.0, 0.5, 1.0), "max_gaussians": None, "data": "abc"}


@pytest.fixture
def snapshot():
    rng = np.random.default_rng(7)
    rng.random(13)
    return Snapshot(42, state(11), (3, 1, 2), rng.bit_generator.state)


def test_a_checkpoint_read_back_is_bit_identical(tmp_path, snapshot):
    write_checkpoint(tmp_path / "checkpoint.npz", snapshot, SETTINGS)
    found = read_checkpoint(tmp_path / "checkpoint.npz", SETTINGS)
    assert (found.iteration, found.pending_views, found.rng) == (42, (3, 1, 2), snapshot.rng)
    assert same_bits(found.state, snapshot.state)


@pytest.mark.parametrize("content", ["nothing", "half", "array", "other archive", "pickle"])
def test_a_file_that_is_not_a_checkpoint_is_refused(tmp_path, snapshot, content):
    path = tmp_path / "checkpoint.npz"
    if content == "nothing":
        path.write_bytes(b"")
    elif content == "half":
        write_checkpoint(path, snapshot, SETTINGS)
        path.write_bytes(path.read_bytes()[:4000])
    elif content == "array":
        with path.open("wb") as stream:
            np.save(stream, np.zeros(3))
    elif content == "other archive":
        np.savez(path, run=np.array("{}"))
    else:
        np.savez(path, run=np.array([{}], dtype=object))
    with pytest.raises(InputError, match=r"checkpoint\.npz: [a-z.]+: expected") as caught:
        read_checkpoint(path, SETTINGS)
    assert "\n" not in str(caught.value)
