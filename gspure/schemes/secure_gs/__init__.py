"""SecureGS (Zhang et al. 2025) on Scaffold-GS: public anchors, from which private networks compute other Gaussians.

Anchors, public and private networks learn together. The paper leaves some choices open. Ours: the loss is L(scene) +
message_weight L(message), each with Scaffold-GS's volume term; anchors grow by the gradients of both branches and are
pruned if neither uses them.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, Final

import numpy as np

from gspure.arrays import Float64
from gspure.constants import ANCHOR_TAU_C, ANCHOR_TAU_N
from gspure.metrics.targets import ADAPTIVE, MESSAGE
from gspure.opencl.device import Device, choose_device
from gspure.schemes.pair import Pair
from gspure.schemes.scheme import PYTORCH, Run, Scheme
from gspure.schemes.secure_gs.anchors import PRIVATE, PUBLIC, SCALINGS, Anchors, fresh
from gspure.schemes.secure_gs.model import NETWORKS, AnchorModel, HiddenKey
from gspure.settings import Amount, Range, Steps
from gspure.training.initialization import LEAST_POINTS, gaussians_at
from gspure.training.trainer import watched

FEAT_DIM: Final = 32  # length of a feature (Scaffold-GS)
K: Final = 10  # Gaussians per anchor (Scaffold-GS)
FIRST_SHARE: Final = 0.5  # largest number of initial anchors, as a share of `max_anchors`; ours
LEAST_ANCHORS: Final = math.ceil(LEAST_POINTS / FIRST_SHARE)
VOXEL_GROWTH: Final = 1.1  # factor by which voxels grow until few enough are occupied; ours


def embed(
    pair: Pair,
    seed: int,
    device: Device | None = None,
    *,
    iterations: Steps = 2000,
    message_weight: Amount = 0.5,
    max_anchors: Annotated[int, Range(LEAST_ANCHORS, 10_000_000)] = 4000,
    density: Annotated[float, Range(1.0, 1e6)] = 2.0,
    hardened: Amount = 0.0,
) -> tuple[AnchorModel, HiddenKey | None]:
    """Hide the pair's message in its scene; a message weight of 0 gives the scene's clean model, and no key.

    `message_weight` is the share of the message's loss; that of the scene is 1. `density` is r_down of the region-aware
    density optimization (`gspure.schemes.secure_gs.growing`); 1 switches it off. `hardened` trains the message also
    without the anchors that ``plain_weight`` removes with this tau, 0 as in the paper. Needs PyTorch.
    """
    from gspure.schemes.secure_gs.training import Training

    rng = np.random.default_rng(seed)
    anchors, voxel = first_anchors([xyz for xyz, _ in pair.clouds], int(FIRST_SHARE * max_anchors))
    branches = [fresh(names, FEAT_DIM, K, rng) for names in (PUBLIC, PRIVATE)]
    settings = Run(pair, iterations, message_weight, max_anchors, seed, device or choose_device(), hardened)
    run = Training(settings, anchors, voxel, branches[: 1 + bool(message_weight)], density)
    for _ in watched(run, iterations, lambda: f"{len(run.learner.anchors.positions)} anchors"):
        pass
    return run.public(), HiddenKey(run.learner.networks(1)) if message_weight else None


def first_anchors(clouds: Sequence[Float64], at_most: int) -> tuple[Anchors, float]:
    """Return an anchor in each voxel with a point, and the least side of the voxels, for points [P,3] of each capture.

    Each capture has its own voxels and an equal share of at most `at_most` anchors: in the voxels of a wide scene, a
    small object would have a handful. The side is the median distance of the capture's points to the nearest
    neighbour, or larger for fewer anchors. (Scaffold-GS has a fixed side per data set.)
    """
    cells, sides = zip(*(_voxels(xyz, at_most // len(clouds)) for xyz in clouds), strict=True)
    positions = np.concatenate([side * cell for cell, side in zip(cells, sides, strict=True)])
    scales = gaussians_at(positions, np.zeros(positions.shape, np.uint8)).log_scales
    anchors = Anchors(
        positions=positions.astype(np.float32),
        offsets=np.zeros((len(positions), K, 3), np.float32),
        features=np.zeros((len(positions), FEAT_DIM), np.float32),
        log_scalings=np.repeat(scales[:, :1], SCALINGS, axis=1),
    )
    return anchors, min(sides)


def _voxels(xyz: Float64, at_most: int) -> tuple[Float64, float]:
    """Return the occupied voxels [C <= at_most, 3] of points [P,3], in units of their side, and the side."""
    from scipy.spatial import KDTree

    side = max(float(np.median(KDTree(xyz).query(xyz, k=2)[0][:, 1])), float(np.finfo(np.float32).tiny))
    while len(cells := np.unique(np.rint(xyz / side), axis=0)) > at_most:
        side *= VOXEL_GROWTH
    return cells, side


READS = dict.fromkeys((MESSAGE, ADAPTIVE), ("x", "y", "z", "f_anchor_feat_*", "scale_*"))
"""Without the offsets, which only the scene uses, and the opacities and rotations, which are unused constants."""

SCHEME = Scheme(
    *("secure_gs", embed, AnchorModel.read, HiddenKey.read, READS, ANCHOR_TAU_C, ANCHOR_TAU_N),
    signature=("f_anchor_feat_0", "f_offset_0"),
    beside=(NETWORKS,),
    packages=PYTORCH,
    fits=True,
)

HARDENED = replace(SCHEME, name="secure_gs_hardened", embed=partial(embed, hardened=2.0))
