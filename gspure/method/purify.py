"""The whole method on one model in one process: contributions, weights, features, clusters, pruning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gspure import __version__
from gspure.arrays import Bools, Float32
from gspure.cameras.camera import Camera
from gspure.constants import MAX_CLUSTER_SHARE, MIN_CLUSTER_SIZE, MIN_SAMPLES, TAU_C, TAU_N
from gspure.errors import InputError, refuse_path
from gspure.method import pruning
from gspure.method.clusters import Labels, Selection, select
from gspure.method.diagnosis import Diagnosis, diagnose
from gspure.method.features import joint_features
from gspure.method.tree import coincident_points, spanning_tree
from gspure.method.weights import Reduction, accumulate, require_in_view
from gspure.model.gaussians import Gaussians
from gspure.progress import say, track
from gspure.public_model import PublicModel
from gspure.text import Described, decimal, percent

if TYPE_CHECKING:
    from gspure.constants import Energy
    from gspure.opencl.device import Device

Array = NDArray[Any]
Weights = Float32

# Memory of purification besides the stored rows, measured with up to six million Gaussians and 32 million pixels
# (benchmarks/bench_purify.py).
_FIXED_BYTES = 500e6  # of Python and the driver
_BYTES_PER_GAUSSIAN = 1150
_BYTES_PER_PIXEL = 120  # of the largest view


@dataclass(frozen=True, eq=False, repr=False)
class Purification(Described):
    """The results of `purify`.

    Parameters
    ----------
    model : Gaussians
        The remaining rows, bit-identical but for a merged 3-D filter, with one more comment line.
    weights : array [K], float32
        Weights ω_k of the input.
    labels : array [K], int32
        Clusters 0 .. M-1; -1 is noise.
    prune_mask : array [K], bool
        True where a row is removed.
    diagnosis : Diagnosis
        Statistics of the clustering and of the pruning, with warnings.

    """

    model: Gaussians
    weights: Weights
    labels: Labels
    prune_mask: Bools
    diagnosis: Diagnosis

    @property
    def facts(self) -> dict[str, str]:
        """Counts of rows and clusters, the pruned shares, and the warnings."""
        diagnosis = self.diagnosis
        return {
            "rows": f"{diagnosis.gaussians:,}",
            "clusters": f"{diagnosis.clusters:,}",
            "pruned rows": percent(diagnosis.pruned_share),
            "pruned weight": percent(diagnosis.pruned_weight_share, 2),
            "warnings": "; ".join(diagnosis.warnings) or "none",
        }


def purify(
    model: Gaussians | PublicModel,
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
    model : Gaussians or PublicModel
        `gspure.schemes.registry.read_public_model` reads the public model of a scheme.
    cameras : sequence of Camera
        The N views over which weights are averaged, at their size. The command ``gspure purify`` averages over the
        training views, at most 1600 px wide: ``split(scaled(cameras, "1600px"))[0]`` of `gspure.cameras`.
    device : Device, optional
        Default: the first that works.
    energy : {"ray", "ewa", "center_ray"}
        Evaluation of a Gaussian at a pixel: the maximum along its ray (the paper's equation), the 2-D splat, or as
        `ray`, but only on the ray through the Gaussian's centre.
    reduction : {"sum", "max", "mean_touched"}
        Reduction over the pixels of a view.
    min_samples, min_cluster_size, selection, max_cluster_share
        See `gspure.method.tree` and `gspure.method.clusters`.
    tau_c, tau_n : float
        Cluster and noise pruning factors.

    Raises
    ------
    InputError
        Before the computation: the model or the views are invalid, a setting is out of range, or there is no device.
        After it: no view shows any row, or every row would be pruned.

    Examples
    --------
    >>> purification = gspure.purify(model, cameras, min_cluster_size=10)
    >>> purification.weights.shape == purification.prune_mask.shape == (400,)
    True

    """
    from gspure.opencl.device import choose_device
    from gspure.renderer import CONTRIBUTION

    def decide(means: Array, opacities: Array, weights: Weights) -> tuple[Labels, Bools, Diagnosis]:
        tree = spanning_tree(joint_features(means, opacities, weights), min_samples, device=device)
        labels = select(tree, min_cluster_size, selection, max_cluster_share, device=device)
        pruned = pruning.prune_mask(labels, weights, tau_c, tau_n)
        return labels, pruned, diagnose(labels, weights, tau_c, tau_n, coincident_points(tree))

    refuse_path("purify", "model", model, expected="Gaussians or a PublicModel", hint="gspure.read_model reads a file")
    hint = "gspure.read_cameras reads a file, gspure.orbit_cameras(model) generates views"
    refuse_path("purify", "cameras", cameras, expected="a list of cameras", hint=hint)
    public = model if isinstance(model, PublicModel) else PublicModel(model)
    public = public.drawable("model")
    rows = public.model
    # Run all steps on a single Gaussian first, so that invalid settings are refused before the long computation.
    weightless = accumulate([np.zeros(0, CONTRIBUTION)], 1, reduction)
    decide(np.zeros((1, 3)), weightless, weightless)

    device = device or choose_device()
    say(f"{len(rows)} Gaussians, {len(cameras)} views, on {device}")
    if public.rows_are_gaussians:
        say(f"memory: at most about {decimal(peak_memory(rows, cameras) / 1e9, 1)} GB")
    views = sorted(cameras, key=lambda camera: camera.name)
    touched = map(public.contributions(device, energy), track(views, "contributions"))
    weights = accumulate(touched, len(rows), reduction)
    require_in_view(weights)
    say(f"clustering {len(rows)} Gaussians")
    labels, pruned, diagnosis = decide(rows.means, public.opacities(views), weights)
    if pruned.all():
        remaining = f"0 of {len(rows)}"
        hint = "prune less: larger tau_c and tau_n"
        raise InputError("pruning", "rows", expected="some to remain", found=remaining, hint=hint)
    settings = f"tau_c={tau_c} tau_n={tau_n} min_cluster_size={min_cluster_size} min_samples={min_samples}"
    kept = rows[~pruned].with_comment(f"gspure {__version__} purified {settings} selection={selection}")
    return Purification(kept, weights, labels, pruned, diagnosis)


def peak_memory(model: Gaussians, cameras: Sequence[Camera]) -> float:
    """Return an upper estimate of the memory in bytes that `gspure purify` needs, including the rows of the file."""
    largest = max((camera.width * camera.height for camera in cameras), default=0)
    return _FIXED_BYTES + model.table.nbytes + _BYTES_PER_GAUSSIAN * len(model) + _BYTES_PER_PIXEL * largest
