"""GS-Hider's files: the authors' layout, round trips, and files that must not be believed."""

import numpy as np
import pytest

from gspure.model import Gaussians, write_model
from gspure.schemes.gs_hider import SCHEME
from gspure.schemes.gs_hider.files import COLUMNS, MESSAGE_DECODER, SCENE_DECODER, DecoderFile

NAME = "chkpnt7_net.pth"


def rows(count=5):
    table = np.zeros(count, [(name, "<f4") for name in COLUMNS])
    rng = np.random.default_rng(0)
    for name in COLUMNS:
        table[name] = rng.standard_normal(count)
    return Gaussians(table)


def state(torch, **changes):
    """A state dict as the authors' code makes it, written out by hand."""
    rng = np.random.default_rng(0)
    shapes = {"conv1": (64, 16, 3, 3), **{f"conv{i}": (64, 64, 3, 3) for i in (2, 3, 4)}, "conv5": (3, 64, 3, 3)}
    arrays = {f"{name}.weight": 0.05 * rng.standard_normal(shape) for name, shape in shapes.items()}
    arrays |= {f"{name}.bias": 0.05 * rng.standard_normal(shape[0]) for name, shape in shapes.items()}
    tensors = {name: torch.tensor(array, dtype=torch.float32) for name, array in arrays.items()}
    tensors |= changes
    return {name: tensor for name, tensor in tensors.items() if tensor is not None}


@pytest.fixture
def torch():
    return pytest.importorskip("torch")


@pytest.fixture
def saved(torch, tmp_path):
    """Saves an object as a decoder's file, and returns that."""

    def save(value):
        torch.save(value, tmp_path / NAME)
        return DecoderFile.read(tmp_path / NAME)

    return save


def authors_layout(torch, folder):
    """A run's folder with two iterations; decoders differ in their last bias."""
    for iteration in (30, 200):
        write_model(folder / "point_cloud" / f"iteration_{iteration}" / "point_cloud.ply", rows())
        for role in (SCENE_DECODER, MESSAGE_DECODER):
            bias = torch.full((3,), float(iteration) + (role == MESSAGE_DECODER))
            torch.save(state(torch, **{"conv5.bias": bias}), folder / f"chkpnt{iteration}_{role}.pth")
    return folder


def last_bias(decoder):
    return decoder.network.conv5.bias[0].item()


def test_the_authors_layout_is_read(torch, tmp_path):
    folder = authors_layout(torch, tmp_path)
    cloud = folder / "point_cloud"
    assert last_bias(SCHEME.read_public(folder).decoder) == 200
    assert last_bias(SCHEME.read_public(cloud / "iteration_30").decoder) == 30
    assert last_bias(SCHEME.read_public(cloud / "iteration_30" / "point_cloud.ply").decoder) == 30
    assert last_bias(SCHEME.read_key(folder).decoder) == 201
    assert last_bias(SCHEME.read_key(cloud / "iteration_30").decoder) == 31


def test_a_decoder_computes_its_convolutions(torch, saved):
    from scipy.signal import correlate

    tensors = state(torch)
    x = np.random.default_rng(1).random((6, 7, 16), dtype=np.float32)
    hidden = x.transpose(2, 0, 1).astype(np.float64)
    for i in range(1, 6):
        weight, bias = (tensors[f"conv{i}.{part}"].double().numpy() for part in ("weight", "bias"))
        padded = np.pad(hidden, ((0, 0), (1, 1), (1, 1)))
        hidden = np.stack([correlate(padded, w, "valid")[0] for w in weight]) + bias[:, None, None]
        hidden = hidden if i == 5 else np.maximum(hidden, 0)
    with torch.inference_mode():
        found = saved(tensors).network(torch.from_numpy(x)).numpy()
    np.testing.assert_allclose(found, hidden.transpose(1, 2, 0), atol=1e-5)
