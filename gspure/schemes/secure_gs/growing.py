"""Anchor growing: new anchors in empty voxels around Gaussians with large gradients (Scaffold-GS, section 3.3).

With region-aware density optimization (RDO, SecureGS), the scene's anchors grow denser around the hidden object.
DBSCAN finds the region where the hidden branch has large gradients. Inside its bounding box, the scene's threshold for
growing is divided by r_down, so that the density of anchors does not reveal the object's shape. The paper does not give
the parameters of the clustering; ours.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gspure.files import Bools, Float32
from gspure.schemes.secure_gs.anchors import SCALINGS, Anchors

GRADIENT_THRESHOLD: Final = 2e-4  # tau of the first level; it doubles with each level (Scaffold-GS)
CELLS: Final = (16, 4, 1)  # sides of a new anchor's cell, in voxels, from the first level to the last (Scaffold-GS)
NEIGHBOURS: Final = 10  # DBSCAN's min_samples; ours
REACH: Final = 16  # DBSCAN's eps in voxels: the side of the largest cell of a new anchor; ours

_BITS = 21


@dataclass(frozen=True, eq=False)
class Candidates:
    """Gaussians that may get a new anchor."""

    positions: Float32  # [C,3], centres, world units
    norms: Float32  # [C], mean norms of their gradients
    thresholds: Float32  # [C] of these norms, at the first level
    features: Float32  # [C,F] of their anchors


def grown(
    positions: Float32, candidates: Candidates, voxel: float, k: int, room: int, rng: np.random.Generator
) -> Anchors:
    """Return new anchors [N <= room], at most one per cell without an anchor.

    At level i, a candidate counts if its gradient reaches 2^i times its threshold, with a probability of 1 - 2^-(i+1).
    A new anchor has the channel-wise largest features of its candidates, and zero offsets.
    """
    parts: list[Anchors] = []
    for level, cell in enumerate(CELLS):
        side = np.float32(voxel * cell)
        chosen = candidates.norms >= candidates.thresholds * 2**level
        chosen &= rng.random(len(chosen)) > 0.5 ** (level + 1)
        cells, owners = np.unique(np.rint(candidates.positions[chosen] / side), axis=0, return_inverse=True)
        owners = owners.reshape(-1)
        strongest = np.zeros(len(cells), np.float32)
        np.maximum.at(strongest, owners, candidates.norms[chosen])
        features = np.full((len(cells), candidates.features.shape[1]), -np.inf, np.float32)
        np.maximum.at(features, owners, candidates.features[chosen])
        taken = [positions, *(part.positions for part in parts)]
        empty = np.flatnonzero(~np.isin(_keys(cells), _keys(np.rint(np.concatenate(taken) / side))))
        best = np.sort(empty[np.argsort(-strongest[empty], kind="stable")[:room]])
        room -= len(best)
        log_scalings = np.full((len(best), SCALINGS), np.log(side), np.float32)
        offsets = np.zeros((len(best), k, 3), np.float32)
        parts.append(Anchors((cells[best] * side).astype(np.float32), offsets, features[best], log_scalings))
    return joined(*parts)


def joined(*parts: Anchors) -> Anchors:
    """Return all anchors of `parts`, in their order."""
    return Anchors(
        *(
            np.concatenate([getattr(p, name) for p in parts])
            for name in ("positions", "offsets", "features", "log_scalings")
        )
    )


def _keys(cells: NDArray[np.floating]) -> NDArray[np.int64]:
    """Return one number per cell [N,3]; indices are clipped to 2^20 cells from the origin."""
    half = 1 << (_BITS - 1)
    x, y, z = (np.clip(cells, -half, half - 1).astype(np.int64) + half).T
    return np.asarray((x << (2 * _BITS)) | (y << _BITS) | z)


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
