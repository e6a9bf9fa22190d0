"""KeySS: the offsets that the network adds."""

import numpy as np
import pytest

from gspure.metrics.targets import MESSAGE
from gspure.public_model import PublicModel
from gspure.schemes.keyss.key import NetworkKey
from gspure.schemes.keyss.network import SHAPES, added, fresh, random_key
from gspure.schemes.pair import read_pair
from tests.models import blobs


def test_an_untrained_network_shows_the_scene(pair_folder):
    public = PublicModel(blobs(50, sh_degree=3))
    camera = read_pair(pair_folder).scene.views[0]
    key = NetworkKey(random_key(np.random.default_rng(0)), fresh(np.random.default_rng(1)))
    assert key.message(public, MESSAGE)(camera).tobytes() == public.scene()(camera).tobytes()


def test_numpy_and_pytorch_add_the_same():
    torch = pytest.importorskip("torch")
    rng = np.random.default_rng(0)
    layers = {name: rng.normal(0, 0.05, shape).astype(np.float32) for name, shape in SHAPES.items()}
    key = NetworkKey(random_key(rng), layers)
    rows = rng.normal(size=(20, 59)).astype(np.float32)
    from gspure.schemes.keyss.training import Learner

    by_torch = Learner(key.network).added(torch.from_numpy(rows), key.vector).detach().numpy()
    np.testing.assert_allclose(by_torch, added(key.network, key.vector, rows), rtol=1e-4, atol=1e-5)
