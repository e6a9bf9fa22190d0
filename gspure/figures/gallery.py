"""All figures of one model and its purification."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cache, partial
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.constants import NOISE_LABEL, TAU_C, TAU_N
from gspure.figures.clouds import Cloud, cluster_cloud, kept_cloud, rank_cloud, share_cloud, truth_cloud
from gspure.figures.export import write_gltf, write_vtp
from gspure.figures.plate import PICTURE_WIDTH, THIRD_WIDTH, write_plate
from gspure.figures.plots import write_weight_histogram
from gspure.figures.portrait import portrait
from gspure.figures.probe import gl_problem
from gspure.figures.viewpoint import MAX_POINTS, choose, fitted, thinned, world_axes

TITLES: Final = ("where the message is", "what goes first", "where it is after pruning")
"""Of the three clouds of a purification."""

_RANKS: Final = (
    "Rank of the weight that decides about a row: the mean of its cluster, or its own if it is noise. Low ranks are "
    "pruned first."
)


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
    hidden : float32 array [K], optional
        Where that is not known, the weights of the Gaussians in views of the message.
    tau_c, tau_n : float
        Pruning factors.
    rows : str
        What the rows of the model are: Gaussians, or anchors.

    """

    means: NDArray[np.float32]
    labels: NDArray[np.int32]
    weights: NDArray[np.float32]
    pruned: NDArray[np.bool_]
    _: KW_ONLY
    carries_message: NDArray[np.bool_] | None = None
    hidden: NDArray[np.float32] | None = None
    tau_c: float = TAU_C
    tau_n: float = TAU_N
    rows: str = "Gaussians"

    @property
    def shows_message(self) -> bool:
        """Whether it is known where the message is, or what of each row's weight goes to it."""
        return self.carries_message is not None or self.hidden is not None


class Drawing(NamedTuple):
    """A figure to be drawn."""

    path: Path
    caption: str
    draw: Callable[[], None]


def draw(
    folder: Path, evidence: Evidence, cameras: Sequence[Camera] = (), view: Camera | None = None
) -> dict[Path, str]:
    """Draw every one of `drawings`; return their captions."""
    captions = {}
    for drawing in drawings(folder, evidence, cameras, view):
        drawing.draw()
        captions[drawing.path] = drawing.caption
    return captions


def drawings(
    folder: Path, evidence: Evidence, cameras: Sequence[Camera] = (), view: Camera | None = None
) -> Iterator[Drawing]:
    """Yield every figure of a model, to be drawn into a folder.

    They write ``clusters``, ``ranks``, ``kept`` and, if it is known where the message is, ``truth`` or ``hidden``, each
    as .png, .gltf and .vtp, and ``weights.png``. ``purification.png`` is as the paper's Fig. 6: where the message is,
    the ranks, and where the message is after pruning. Without a working OpenGL numpy draws the clouds, and their
    captions say so.

    Parameters
    ----------
    folder : Path
        Created if need be.
    evidence : Evidence
    cameras : sequence of Camera
        The model's views: they say which way is up, and whether to look from outside or from within.
    view : Camera, optional
        Where to look from instead.

    """
    means = evidence.means
    problem = gl_problem()
    remarks = list(_remarks(len(means), problem))

    @cache
    def eye() -> Camera:
        return view or choose(means, cameras)

    def draw_cloud(name: str, make: Callable[[], Cloud]) -> None:
        cloud = make()
        shown = cloud.subset(thinned(len(cloud)))
        picture = portrait(shown, fitted(eye(), PICTURE_WIDTH), opengl=problem is None)
        write_plate(folder / f"{name}.png", [picture], [shown])
        write_gltf(folder / f"{name}.gltf", shown, world_axes(means, cameras))
        write_vtp(folder / f"{name}.vtp", shown)

    def draw_purification() -> None:
        clouds = [cloud.subset(thinned(len(cloud))) for cloud in _purification(evidence)]
        pictures = [portrait(cloud, fitted(eye(), THIRD_WIDTH), opengl=problem is None) for cloud in clouds]
        write_plate(folder / "purification.png", pictures, clouds, TITLES)

    for name, make, caption in _clouds(evidence):
        path = folder / f"{name}.png"
        yield Drawing(path, " ".join([caption, *remarks]), partial(draw_cloud, name, make))
    if evidence.shows_message:
        caption = " ".join([_message_caption(evidence), _RANKS, *_pruned_weight(evidence), *remarks])
        yield Drawing(folder / "purification.png", caption, draw_purification)
    histogram = folder / "weights.png"
    shown = histogram, evidence.weights, evidence.pruned, evidence.tau_c, evidence.tau_n, evidence.rows
    yield Drawing(histogram, _histogram_caption(evidence), partial(write_weight_histogram, *shown))


def _clouds(evidence: Evidence) -> Iterator[tuple[str, Callable[[], Cloud], str]]:
    means, labels, rows = evidence.means, evidence.labels, evidence.rows
    clusters = int(labels.max(initial=NOISE_LABEL)) + 1
    caption = f"{clusters} clusters of the {len(means):,} {rows}, by HDBSCAN on position, opacity and weight."
    caption += " Each has its share in the legend; noise is grey."
    yield "clusters", partial(cluster_cloud, means, labels), caption
    yield "ranks", partial(rank_cloud, means, labels, evidence.weights), _RANKS
    caption = f"{evidence.pruned.sum():,} of {len(means):,} {rows} are pruned."
    yield "kept", partial(kept_cloud, means, evidence.pruned), caption
    if evidence.shows_message:
        name = "hidden" if evidence.carries_message is None else "truth"
        yield name, partial(_message_cloud, evidence, np.ones_like(evidence.pruned)), _message_caption(evidence)


def _purification(evidence: Evidence) -> list[Cloud]:
    """Return where the message is, the ranks, and where it is after pruning."""
    before, after = (_message_cloud(evidence, chosen) for chosen in (np.ones_like(evidence.pruned), ~evidence.pruned))
    return [before, rank_cloud(evidence.means, evidence.labels, evidence.weights), after]


def _message_cloud(evidence: Evidence, chosen: NDArray[np.bool_]) -> Cloud:
    """Return where among the `chosen` rows (bool [K]) the message is; `Evidence.shows_message` must hold."""
    means = evidence.means[chosen]
    if evidence.carries_message is not None:
        return truth_cloud(means, evidence.carries_message[chosen])
    if evidence.hidden is None:
        raise ValueError("it is not known where the message is")
    return share_cloud(means, evidence.weights[chosen], evidence.hidden[chosen])


def _message_caption(evidence: Evidence) -> str:
    if evidence.carries_message is not None:
        return f"Ground truth: {evidence.carries_message.sum():,} {evidence.rows} carry the message."
    caption = (
        f"The share of the weight of each of the {evidence.rows} that goes to the message: h / (h + ω), of what it "
        "contributes to views of the message (h) and of the scene (ω); grey where both are 0."
    )
    if evidence.hidden is not None and np.allclose(evidence.hidden, evidence.weights):
        caption += " Each serves both alike: what tells message from scene is not where it is."
    return caption


def _pruned_weight(evidence: Evidence) -> Iterator[str]:
    """Say what pruning takes from scene and message, where both have a weight."""
    if evidence.hidden is not None:
        taken = [_share(values, evidence.pruned) for values in (evidence.hidden, evidence.weights)]
        yield f"Pruning takes {taken[0]:.1%} of the weight in the message and {taken[1]:.1%} of that in the scene."


def _share(values: NDArray[np.float32], chosen: NDArray[np.bool_]) -> float:
    total = float(values.sum(dtype=np.float64))
    return float(values[chosen].sum(dtype=np.float64)) / total if total else 0.0


def _remarks(count: int, problem: str | None) -> Iterator[str]:
    if count > MAX_POINTS:
        yield f"{MAX_POINTS:,} of them are drawn, chosen at random."
    if problem:
        yield f"Drawn without OpenGL ({problem})."


def _histogram_caption(evidence: Evidence) -> str:
    unseen = float(np.mean(evidence.weights == 0))
    return (
        f"Weights of the {evidence.rows}, averaged over the views; {unseen:.1%} have weight 0, as no view shows them. "
        f"Pruned are clusters whose mean weight is below the mean of all / {evidence.tau_c:g}, and noise points whose "
        f"own is below the mean of all / {evidence.tau_n:g}. "
        "What is kept left of the threshold, or pruned right of it, is in a cluster that was judged as a whole."
    )
