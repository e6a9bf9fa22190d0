"""Small Scaffold-GS models, shared by the tests of SecureGS."""

import numpy as np

from gspure.schemes.secure_gs.anchors import Anchors
from gspure.schemes.secure_gs.model import AnchorModel, HiddenKey
from gspure.schemes.secure_gs.networks import PRIVATE, PUBLIC, fresh


def random_anchors(count=40, k=4, feat_dim=8, seed=0) -> Anchors:
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


def distant(names, feat_dim, k, rng):
    """Untrained networks that all see the distance."""
    networks = fresh(names, feat_dim, k, rng)
    for network in networks.values():
        short = feat_dim + 4 - network["0.weight"].shape[1]
        extra = rng.normal(size=(feat_dim, short)).astype(np.float32)
        network["0.weight"] = np.concatenate([network["0.weight"], extra], axis=1)
    return networks


def feature_bank(hidden, rng):
    shapes = {"0.weight": (hidden, 4), "0.bias": (hidden,), "2.weight": (3, hidden), "2.bias": (3,)}
    return {name: rng.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}


def random_public(count=40, k=4, feat_dim=8, seed=0, *, bank=False) -> AnchorModel:
    rng = np.random.default_rng(seed + 100)
    networks = fresh(PUBLIC, feat_dim, k, rng)
    if bank:
        networks["feature_bank"] = feature_bank(feat_dim, rng)
    return AnchorModel(random_anchors(count, k, feat_dim, seed).table, networks)


def random_key(k=4, feat_dim=8, seed=0) -> HiddenKey:
    return HiddenKey(fresh(PRIVATE, feat_dim, k, np.random.default_rng(seed + 200)))
