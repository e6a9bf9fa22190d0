"""Region-aware density optimization (RDO): anchors of the scene grow denser around what is hidden (SecureGS).

Where the hidden branch has large gradients lies what it shows. DBSCAN finds the region; inside its bounding box the
scene's threshold for growing is divided by r_down, so that the density of anchors does not betray its shape. The
clustering's parameters are not known: ours.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Float32 = NDArray[np.float32]

NEIGHBOURS: Final = 10
"""DBSCAN's min_samples. Ours."""

REACH: Final = 16
"""DBSCAN's eps in voxels: the side of the largest cell that an anchor grows in. Ours."""


def hidden_box(places: Float32, voxel: float) -> tuple[Float32, Float32] | None:
    """Return the lowest and highest corner [3] of what is clustered among `places` [C,3], if anything is."""
    from sklearn.cluster import DBSCAN

    if len(places) < NEIGHBOURS:
        return None
    clustered = places[DBSCAN(eps=REACH * voxel, min_samples=NEIGHBOURS).fit(places).labels_ >= 0]
    return (clustered.min(axis=0), clustered.max(axis=0)) if len(clustered) else None


def inside(box: tuple[Float32, Float32] | None, places: Float32) -> NDArray[np.bool_]:
    """Tell which places [...,3] lie in the box."""
    if box is None:
        return np.zeros(places.shape[:-1], bool)
    return np.asarray(((places >= box[0]) & (places <= box[1])).all(axis=-1))
