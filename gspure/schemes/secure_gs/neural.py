"""Neural Gaussians, computed from anchors and networks for one camera (Scaffold-GS, ``generate_neural_gaussians``).

The formulas serve rendering and measuring with numpy and training with torch (`xp` is the library). In a hidden branch,
a network computes the offsets too (SecureGS, Eq. 4).
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from gspure.constants import SH_DC
from gspure.model import Gaussians
from gspure.public_model import Rows
from gspure.schemes.secure_gs.anchors import Anchors, rows_of
from gspure.schemes.secure_gs.networks import Network, Networks, perceptron, takes_distance

LARGEST_OPACITY: Final = np.float32(1 - 2**-20)  # in tables: logits are finite; rendering clips alpha at 0.99


@dataclass(frozen=True, eq=False)
class Neural:
    """The k Gaussians of each of V anchors for one camera; A of them are active, and activated."""

    outputs: Any  # [V,k] of the opacity network, -1 to 1; Gaussians with a positive one are active
    active: Any  # [A], indices into the V k Gaussians, anchor by anchor
    means: Any  # [A,3]
    quats: Any  # [A,4]
    scales: Any  # [A,3]
    opacities: Any  # [A]
    colors: Any  # [A,3]


def neural(xp: Any, anchors: Anchors, networks: Networks, centre: Any) -> Neural:
    """Return the Gaussians of `anchors` [V] for a camera at `centre` [3]."""
    away = anchors.positions - centre
    distances = xp.sqrt((away * away).sum(axis=1))[:, None]
    views = away / distances
    features = anchors.features
    if "feature_bank" in networks:
        features = _blended(xp, networks["feature_bank"], features, xp.concatenate([views, distances], axis=1))
    near = xp.concatenate([features, views], axis=1)
    far = xp.concatenate([near, distances], axis=1)

    def outputs(name: str) -> Any:
        network = networks[name]
        return perceptron(xp, network, far if takes_distance(network, anchors.feat_dim) else near)

    opacities = xp.tanh(outputs("opacity"))
    count = opacities.shape[0] * anchors.k
    active = xp.argwhere(~(opacities.reshape(count) <= 0))[:, 0]  # with not-a-number, so that it is noticed
    owners = active // anchors.k
    offsets = outputs("offset").reshape(count, 3) if "offset" in networks else anchors.offsets.reshape(count, 3)
    scalings = rows_of(xp.exp(anchors.log_scalings), owners)
    shapes = rows_of(outputs("cov").reshape(count, 7), active)
    quats = shapes[:, 3:]
    return Neural(
        outputs=opacities,
        active=active,
        means=rows_of(anchors.positions, owners) + rows_of(offsets, active) * scalings[:, :3],
        quats=quats / xp.sqrt((quats * quats).sum(axis=1))[:, None],
        scales=scalings[:, 3:] * _sigmoid(xp, shapes[:, :3]),
        opacities=rows_of(opacities.reshape(count), active),
        colors=_sigmoid(xp, rows_of(outputs("color").reshape(count, 3), active)),
    )


def as_gaussians(gaussians: Neural, rows: Rows, k: int) -> tuple[Gaussians, Rows]:
    """Return the active Gaussians, with colours of degree 0, and the anchor of each; `rows` [V] are the anchors'."""
    tiny = np.finfo(np.float32).tiny
    table = Gaussians.from_parameters(
        means=gaussians.means,
        quats=gaussians.quats,
        scales=np.maximum(gaussians.scales, tiny),
        opacities=np.clip(gaussians.opacities, tiny, LARGEST_OPACITY),
        sh_coeffs=((gaussians.colors - 0.5) / SH_DC)[:, None, :],
    )
    return table, rows[gaussians.active // k]


def _blended(xp: Any, bank: Network, features: Any, views: Any) -> Any:
    """Blend features at three resolutions, every fourth, second and single number, with weights by view."""
    logits = perceptron(xp, bank, views)
    weights = xp.exp(logits - xp.amax(logits, axis=1, keepdims=True))
    weights = weights / weights.sum(axis=1)[:, None]
    coarse, middle = xp.tile(features[:, ::4], (1, 4)), xp.tile(features[:, ::2], (1, 2))
    return coarse * weights[:, 0:1] + middle * weights[:, 1:2] + features * weights[:, 2:3]


def _sigmoid(xp: Any, x: Any) -> Any:
    return (xp.tanh(x / 2) + 1) / 2  # neither overflows nor has a gradient of not-a-number
