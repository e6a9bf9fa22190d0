"""Small Scaffold-GS models, shared by the tests of SecureGS."""

import numpy as np

from gspure_torch.secure_gs.anchors import PRIVATE, PUBLIC, Anchors, fresh
from gspure_torch.secure_gs.key import HiddenKey
from gspure_torch.secure_gs.model import AnchorModel


def random_anchors(count: int = 40, k: int = 4, feat_dim: int = 8, seed: int = 0) -> Anchors:
    """Anchors before the cameras of `tests.models`."""
    rng = np.random.default_rng(seed)
    depths = rng.uniform(3.0, 9.0, count)
    slopes = rng.uniform(-0.6, 0.6, (2, count))
    return Anchors(
        positions=np.stack([*(slopes * depths), depths], axis=1).astype(np.float32),
        offsets=rng.normal(size=(count, k, 3)).astype(np.float32),
        features=rng.normal(size=(count, feat_dim)).astype(np.float32),
        log_scalings=rng.uniform(-2.5, -0.5, (count, 6)).astype(np.float32),
    )


def random_public(count: int = 40, k: int = 4, feat_dim: int = 8, seed: int = 0) -> AnchorModel:
    networks = fresh(PUBLIC, feat_dim, k, np.random.default_rng(seed + 100))
    return AnchorModel(random_anchors(count, k, feat_dim, seed).table, networks)


def random_key(k: int = 4, feat_dim: int = 8, seed: int = 0) -> HiddenKey:
    return HiddenKey(fresh(PRIVATE, feat_dim, k, np.random.default_rng(seed + 200)))
