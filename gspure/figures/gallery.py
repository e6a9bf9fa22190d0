"""All figures of one model and its purification."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cache, partial
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from gspure.cameras.camera import Camera
from gspure.constants import NOISE_LABEL, TAU_C, TAU_N
from gspure.figures.clouds import Cloud, cluster_cloud, kept_cloud, rank_cloud, share_cloud
from gspure.figures.export import write_gltf, write_vtp
from gspure.figures.plate import PAGE_WIDTH, PICTURE_WIDTH, write_plate
from gspure.figures.plots import write_weight_histogram
from gspure.figures.portrait import portrait
from gspure.figures.probe import gl_problem
from gspure.figures.viewpoint import MAX_POINTS, choose, fitted, thinned, world_axes
from gspure.files import Bools, Float32, Int32
from gspure.progress import percent
from gspure.public_model import RenderView

TITLES: Final = ("model", "message before pruning", "rank of the weight", "message after pruning")
"""Titles of the render and the three clouds of a purification."""

NAMES: Final = tuple(
    f"{name}{suffix}"
    for name in ("before_after", "clusters", "hidden", "kept", "purification", "ranks", "splats", "weights")
    for suffix in (".png", ".svg", ".gltf", ".vtp")
)
"""Names of the files of all figures of a model."""

_RANKS: Final = (
    "Rank: the order by τ_c times the mean weight of the cluster or, outside clusters, τ_n times the weight. GSPure "
    "prunes the lowest ranks."
)


@dataclass(frozen=True)
class Evidence:
    """The data of the figures of one model with K >= 1 rows, Gaussians or anchors.

    `pruned` is true where a row is pruned; `hidden` are weights in views of the message, if there is one.
    """

    means: Float32
    labels: Int32
    weights: Float32
    pruned: Bools
    _: KW_ONLY
    hidden: Float32 | None = None
    tau_c: float = TAU_C
    tau_n: float = TAU_N
    rows: str = "Gaussians"


class Drawing(NamedTuple):
    """A figure before it is drawn."""

    path: Path
    caption: str
    draw: Callable[[], None]


def drawings(
    folder: Path, evidence: Evidence, cameras: Sequence[Camera] = (), render: RenderView | None = None
) -> Iterator[Drawing]:
    """Yield every figure of a model.

    They write ``clusters``, ``ranks``, ``kept`` and, of a model with a message, ``hidden``, each as .png, .gltf and
    .vtp, and ``weights`` as .png and .svg. ``purification.png`` follows the paper's Fig. 6: the model, if there is a
    function to `render` it, the message before pruning, the ranks, and the message after pruning, all from one
    viewpoint. Without OpenGL, numpy draws the clouds, and their captions say so.

    The model's views, `cameras`, determine the up direction and whether to look from outside or from within.
    """
    means = evidence.means
    problem = gl_problem()
    remarks = list(_remarks(len(means), problem))

    @cache
    def eye() -> Camera:
        return choose(means, cameras)

    def draw_cloud(name: str, make: Callable[[], Cloud]) -> None:
        cloud = make()
        shown = cloud.subset(thinned(len(cloud)))
        picture = portrait(shown, fitted(eye(), PICTURE_WIDTH), opengl=problem is None)
        write_plate(folder / f"{name}.png", [picture], [shown])
        write_gltf(folder / f"{name}.gltf", shown, world_axes(means, cameras))
        write_vtp(folder / f"{name}.vtp", shown)

    def draw_purification(hidden: Float32) -> None:
        clouds = [cloud.subset(thinned(len(cloud))) for cloud in _purification(evidence, hidden)]
        count = len(clouds) + (render is not None)
        camera = fitted(eye(), PAGE_WIDTH // count)
        pictures = [portrait(cloud, camera, opengl=problem is None) for cloud in clouds]
        if render:
            pictures.insert(0, np.rint(255 * render(camera).clip(0, 1)).astype(np.uint8))
            clouds.insert(0, Cloud(evidence.means[:0], np.empty((0, 3), np.uint8), {}))
        write_plate(folder / "purification.png", pictures, clouds, TITLES[-count:])

    for name, make, caption in _clouds(evidence):
        path = folder / f"{name}.png"
        yield Drawing(path, " ".join([caption, *remarks]), partial(draw_cloud, name, make))
    if (hidden := evidence.hidden) is not None:
        caption = " ".join([_message_caption(evidence, hidden), _RANKS, _pruned_weight(evidence, hidden), *remarks])
        yield Drawing(folder / "purification.png", caption, partial(draw_purification, hidden))
    histogram = folder / "weights.png"
    arguments = histogram, evidence.weights, evidence.pruned, evidence.tau_c, evidence.tau_n, evidence.rows
    yield Drawing(histogram, _histogram_caption(evidence), partial(write_weight_histogram, *arguments))


def _clouds(evidence: Evidence) -> Iterator[tuple[str, Callable[[], Cloud], str]]:
    means, labels, rows = evidence.means, evidence.labels, evidence.rows
    clusters = int(labels.max(initial=NOISE_LABEL)) + 1
    caption = (
        f"{clusters} cluster{'s' * (clusters != 1)} of the {len(means):,} {rows}, by HDBSCAN on position, opacity "
    )
    caption += "and weight. The legend gives their shares. Kept clusters are pale, noise is grey."
    yield "clusters", partial(cluster_cloud, means, labels, evidence.pruned), caption
    yield "ranks", partial(ranks, evidence), _RANKS
    caption = f"{evidence.pruned.sum():,} of {len(means):,} {rows} are pruned."
    yield "kept", partial(kept_cloud, means, evidence.pruned), caption
    if (hidden := evidence.hidden) is not None:
        yield "hidden", partial(share_cloud, means, evidence.weights, hidden), _message_caption(evidence, hidden)


def _purification(evidence: Evidence, hidden: Float32) -> list[Cloud]:
    """Return the message before pruning, the ranks, and the message after pruning."""
    before = share_cloud(evidence.means, evidence.weights, hidden)
    return [before, ranks(evidence), before.subset(~evidence.pruned)]


def ranks(evidence: Evidence) -> Cloud:
    """Return the cloud of the ranks by which GSPure prunes."""
    return rank_cloud(evidence.means, evidence.labels, evidence.weights, evidence.tau_c, evidence.tau_n)


def _message_caption(evidence: Evidence, hidden: Float32) -> str:
    caption = (
        f"Share of the message in the weight of the {evidence.rows}: h / (h + ω), where h is the weight in views of "
        "the message, and ω that in views of the scene; grey where both are 0."
    )
    if np.allclose(hidden, evidence.weights):
        caption += " Both weights are equal everywhere: message and scene share all Gaussians."
    return caption


def _pruned_weight(evidence: Evidence, hidden: Float32) -> str:
    if not hidden.any():
        return "No row holds weight of the message."
    message, scene = (_share(values, evidence.pruned) for values in (hidden, evidence.weights))
    return f"Pruning removes {percent(message)} of the weight in the message and {percent(scene)} of that in the scene."


def _share(values: Float32, chosen: Bools) -> float:
    total = float(values.sum(dtype=np.float64))
    return float(values[chosen].sum(dtype=np.float64)) / total if total else 0.0


def _remarks(count: int, problem: str | None) -> Iterator[str]:
    if count > MAX_POINTS:
        yield f"A random {MAX_POINTS:,} of them are drawn."
    if problem:
        yield f"Drawn without OpenGL ({problem})."


def _histogram_caption(evidence: Evidence) -> str:
    zero = percent(float(np.mean(evidence.weights == 0)))
    return (
        f"Histogram of the weights ω, with mean ω̄. {zero} are 0: these {evidence.rows} contribute to no pixel. "
        f"GSPure prunes clusters if their mean weight is below ω̄/{evidence.tau_c:g}, and {evidence.rows} in no "
        f"cluster if their weight is below ω̄/{evidence.tau_n:g}. Clusters are pruned as a whole, so {evidence.rows} "
        "above the threshold can be pruned, and others below it kept."
    )
