"""All figures of one model and its purification."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.constants import NOISE_LABEL, TAU_C, TAU_N
from gspure.figures.clouds import Cloud, cluster_cloud, kept_cloud, rank_cloud, truth_cloud
from gspure.figures.export import write_gltf, write_vtp
from gspure.figures.plate import PICTURE_WIDTH, write_plate
from gspure.figures.plots import write_weight_histogram
from gspure.figures.portrait import portrait
from gspure.figures.probe import gl_problem
from gspure.figures.viewpoint import MAX_POINTS, choose, fitted, thinned, world_axes


@dataclass(frozen=True)
class Evidence:
    """What the figures of one model show.

    Parameters
    ----------
    means : float32 array [K,3]
        Centres; K is at least 1.
    labels : int32 array [K]
        Clusters, -1 for noise.
    weights : float32 array [K]
        View-accumulated weights.
    pruned : bool array [K]
        True where a Gaussian is pruned.
    carries_message : bool array [K], optional
        True where a Gaussian is known to carry the message.
    tau_c, tau_n : float
        Pruning factors.

    """

    means: NDArray[np.float32]
    labels: NDArray[np.int32]
    weights: NDArray[np.float32]
    pruned: NDArray[np.bool_]
    carries_message: NDArray[np.bool_] | None = None
    tau_c: float = TAU_C
    tau_n: float = TAU_N


def draw(
    folder: Path, evidence: Evidence, cameras: Sequence[Camera] = (), view: Camera | None = None
) -> dict[Path, str]:
    """Draw every figure of a model into a folder.

    Writes ``clusters``, ``ranks``, ``kept`` and, where it is known who carries the message, ``truth``, each as .png,
    .gltf and .vtp, and ``weights.png``. Without a working OpenGL numpy draws the clouds, and their captions say so.

    Parameters
    ----------
    folder : Path
        Created if need be.
    evidence : Evidence
    cameras : sequence of Camera
        The model's views: they say which way is up, and whether to look from outside or from within.
    view : Camera, optional
        Where to look from instead.

    Returns
    -------
    dict of Path to str
        The caption of every PNG.

    """
    means = evidence.means
    camera = fitted(view or choose(means, cameras), PICTURE_WIDTH)
    axes = world_axes(means, cameras)
    problem = gl_problem()
    rows = thinned(len(means))
    captions = {}
    for name, cloud, caption in _clouds(evidence):
        shown = cloud.subset(rows)
        write_plate(folder / f"{name}.png", portrait(shown, camera, opengl=problem is None), shown)
        write_gltf(folder / f"{name}.gltf", shown, axes)
        write_vtp(folder / f"{name}.vtp", shown)
        captions[folder / f"{name}.png"] = " ".join([caption, *_remarks(len(means), problem)])
    histogram = folder / "weights.png"
    write_weight_histogram(histogram, evidence.weights, evidence.pruned, evidence.tau_c, evidence.tau_n)
    captions[histogram] = _histogram_caption(evidence)
    return captions


def _clouds(evidence: Evidence) -> Iterator[tuple[str, Cloud, str]]:
    means, labels = evidence.means, evidence.labels
    clusters = int(labels.max(initial=NOISE_LABEL)) + 1
    caption = f"{clusters} clusters of the {len(means):,} Gaussians, by HDBSCAN on position, opacity and weight."
    yield "clusters", cluster_cloud(means, labels), caption + " Each has its share in the legend; noise is grey."
    caption = (
        "Rank of the weight that decides about a Gaussian: the mean of its cluster, or its own if it is noise. "
        "Low ranks are pruned first."
    )
    yield "ranks", rank_cloud(means, labels, evidence.weights), caption
    caption = f"{evidence.pruned.sum():,} of {len(means):,} Gaussians are pruned."
    yield "kept", kept_cloud(means, evidence.pruned), caption
    if evidence.carries_message is not None:
        caption = f"Ground truth: {evidence.carries_message.sum():,} Gaussians carry the message."
        yield "truth", truth_cloud(means, evidence.carries_message), caption


def _remarks(count: int, problem: str | None) -> Iterator[str]:
    if count > MAX_POINTS:
        yield f"{MAX_POINTS:,} of them are drawn, chosen at random."
    if problem:
        yield f"Drawn without OpenGL ({problem})."


def _histogram_caption(evidence: Evidence) -> str:
    unseen = float(np.mean(evidence.weights == 0))
    return (
        f"Weights of the Gaussians, averaged over the views; {unseen:.1%} have weight 0, as no view shows them. Pruned "
        f"are clusters whose mean weight is below the mean of all / {evidence.tau_c:g}, and noise points whose own is "
        f"below the mean of all / {evidence.tau_n:g}. "
        "What is kept left of the threshold, or pruned right of it, is in a cluster that was judged as a whole."
    )
