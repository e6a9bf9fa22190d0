"""The whole method on one model in one process: contributions, weights, features, clusters, pruning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gspure import __version__, pruning
from gspure.cameras.camera import Camera
from gspure.clustering import Diagnosis, Selection, coincident_points, diagnose, select, spanning_tree
from gspure.clustering.selection import Labels
from gspure.constants import MAX_CLUSTER_SHARE, MIN_CLUSTER_SIZE, MIN_SAMPLES, TAU_C, TAU_N
from gspure.features import features
from gspure.model.gaussians import Gaussians
from gspure.progress import say, track
from gspure.pruning import Mask
from gspure.schemes.asset import Asset
from gspure.weights import Reduction, accumulate

if TYPE_CHECKING:
    from gspure.opencl.device import Device
    from gspure.opencl.frame import Energy

Array = NDArray[Any]
Weights = NDArray[np.float32]


@dataclass(frozen=True)
class Purification:
    """What `purify` found and did.

    Parameters
    ----------
    model : Gaussians
        The rows that remain, bit-identical, with one comment line more.
    weights : array [K], float32
        View-accumulated weights ω_k of the given model.
    labels : array [K], int32
        Clusters 0 .. M-1; -1 is noise.
    pruned : array [K], bool
        True where removed.
    diagnosis : Diagnosis
        The clustering in numbers, with its warnings.

    """

    model: Gaussians
    weights: Weights
    labels: Labels
    pruned: Mask
    diagnosis: Diagnosis


def purify(
    model: Gaussians | Asset,
    cameras: Sequence[Camera],
    *,
    device: Device | None = None,
    energy: Energy = "ray",
    reduction: Reduction = "sum",
    min_samples: int = MIN_SAMPLES,
    min_cluster_size: int = MIN_CLUSTER_SIZE,
    selection: Selection = "eom_capped",
    max_cluster_share: float = MAX_CLUSTER_SHARE,
    tau_c: float = TAU_C,
    tau_n: float = TAU_N,
) -> Purification:
    """Run GSPure on one model: contributions, weights, features, clusters, pruning (paper, §Methodology).

    Parameters
    ----------
    model : Gaussians or Asset
        The public model; of a scheme whose rows are no Gaussians, or whose colours are no spherical harmonics, the
        asset that `gspure.schemes.registry.open_asset` reads.
    cameras : sequence of Camera
        The N views whose contributions count; they are taken in the order of their names.
    device : Device, optional
        Default: the first that works.
    energy : {"ray", "ewa"}
        How a Gaussian meets a pixel: the maximum along its ray (the paper's equation), or the 2-D splat.
    reduction : {"sum", "max", "mean_touched"}
        How the pixels of a view become one number.
    min_samples, min_cluster_size, selection, max_cluster_share
        See `gspure.clustering`.
    tau_c, tau_n : float
        Cluster and noise pruning factors.

    Raises
    ------
    InputError
        If the model or the views are unfit, a setting is out of range, or there is no device; before anything is
        computed.

    """
    from gspure.opencl.device import choose_device
    from gspure.renderer import CONTRIBUTION

    def decide(means: Array, opacities: Array, weights: Weights) -> tuple[Labels, Mask, Diagnosis]:
        tree = spanning_tree(features(means, opacities, weights), min_samples, device=device)
        labels = select(tree, min_cluster_size, selection, max_cluster_share, device=device)
        pruned = pruning.prune_mask(labels, weights, tau_c, tau_n)
        return labels, pruned, diagnose(labels, weights, tau_c, tau_n, coincident_points(tree))

    asset = model if isinstance(model, Asset) else Asset(model)
    asset = asset.drawable("model")
    units = asset.units
    # Each stage refuses settings that are out of range: one unseen Gaussian goes through all of them ahead of the rest.
    unseen = accumulate([np.zeros(0, CONTRIBUTION)], 1, reduction)
    decide(np.zeros((1, 3)), unseen, unseen)

    device = device or choose_device()
    say(f"{len(units)} Gaussians, {len(cameras)} views, on {device}")
    views = sorted(cameras, key=lambda camera: camera.name)
    stages = map(asset.contributions(device, energy), track(views, "contributions"))
    weights = accumulate(stages, len(units), reduction)
    say(f"clustering {len(units)} Gaussians")
    labels, pruned, diagnosis = decide(units.means, asset.opacities(views), weights)
    said = f"tau_c={tau_c} tau_n={tau_n} min_cluster_size={min_cluster_size} min_samples={min_samples}"
    return Purification(
        units.subset(~pruned).with_comment(f"gspure {__version__} purified {said} selection={selection}"),
        weights,
        labels,
        pruned,
        diagnosis,
    )
