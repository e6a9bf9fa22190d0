"""Region-aware density optimization (RDO): anchors of the scene grow denser around the hidden object (SecureGS).

DBSCAN finds the region where the hidden branch has large gradients. Inside its bounding box, the scene's threshold for
growing is divided by r_down, so that the density of anchors does not reveal the object's shape. The paper does not give
the parameters of the clustering; ours.
"""

from typing import Final

import numpy as np

from gspure.dtypes import Bools, Float32

NEIGHBOURS: Final = 10
"""DBSCAN's min_samples. Ours."""

REACH: Final = 16
"""DBSCAN's eps in voxels: the side of the largest cell of a new anchor. Ours."""


def hidden_box(positions: Float32, voxel: float) -> tuple[Float32, Float32] | None:
    """Return the lowest and highest corner [3] of the clusters in `positions` [C,3]; None without clusters."""
    from sklearn.cluster import DBSCAN

    if len(positions) < NEIGHBOURS:
        return None
    clustered = positions[DBSCAN(eps=REACH * voxel, min_samples=NEIGHBOURS).fit(positions).labels_ >= 0]
    return (clustered.min(axis=0), clustered.max(axis=0)) if len(clustered) else None


def inside(box: tuple[Float32, Float32] | None, positions: Float32) -> Bools:
    """Return the mask of the positions [...,3] in the box."""
    if box is None:
        return np.zeros(positions.shape[:-1], bool)
    return np.asarray(((positions >= box[0]) & (positions <= box[1])).all(axis=-1))
