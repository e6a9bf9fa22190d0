"""The anchors that training starts from: one in each voxel with a point (Scaffold-GS, section 3.2.1)."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from gspure.arrays import Float64
from gspure.training.initialization import LEAST_POINTS, gaussians_at
from gspure_torch.secure_gs.anchors import SCALINGS, Anchors

FEAT_DIM: Final = 32  # length of a feature (Scaffold-GS)
GAUSSIANS_PER_ANCHOR: Final = 10  # k (Scaffold-GS)
FIRST_SHARE: Final = 0.5  # largest number of initial anchors, as a share of `max_anchors`; ours
LEAST_ANCHORS: Final = math.ceil(LEAST_POINTS / FIRST_SHARE)
VOXEL_GROWTH: Final = 1.1  # factor by which voxels grow until few enough are occupied; ours


def first_anchors(clouds: Sequence[Float64], at_most: int) -> tuple[Anchors, float]:
    """Return an anchor in each voxel with a point, and the least side of the voxels, for points [P,3] of each capture.

    Each capture has its own voxels and an equal share of at most `at_most` anchors: in the voxels of a wide scene, a
    small object would have a handful. The side is the median distance of the capture's points to the nearest
    neighbour, or larger for fewer anchors. (Scaffold-GS has a fixed side per data set.)
    """
    centres: list[Float64] = []
    sides: list[float] = []
    for xyz in clouds:
        cells, side = _voxels(xyz, at_most // len(clouds))
        centres.append(side * cells)
        sides.append(side)
    positions = np.concatenate(centres)
    scales = gaussians_at(positions, np.zeros(positions.shape, np.uint8)).log_scales
    anchors = Anchors(
        positions=positions.astype(np.float32),
        offsets=np.zeros((len(positions), GAUSSIANS_PER_ANCHOR, 3), np.float32),
        features=np.zeros((len(positions), FEAT_DIM), np.float32),
        log_scalings=np.repeat(scales[:, :1], SCALINGS, axis=1),
    )
    return anchors, min(sides)


def _voxels(xyz: Float64, at_most: int) -> tuple[Float64, float]:
    """Return the occupied voxels [C <= at_most, 3] of points [P,3], in units of their side, and the side."""
    from scipy.spatial import KDTree

    nearest = KDTree(xyz).query(xyz, k=2)[0][:, 1]
    side = max(float(np.median(nearest)), float(np.finfo(np.float32).tiny))
    while len(cells := np.unique(np.rint(xyz / side), axis=0)) > at_most:
        side *= VOXEL_GROWTH
    return cells, side
