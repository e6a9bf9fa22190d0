"""All figures of one model and its purification."""

from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.lib.recfunctions import repack_fields

from gspure.cameras.camera import Camera, split
from gspure.constants import NOISE_LABEL
from gspure.figures import style
from gspure.figures.charts import write_weight_histogram
from gspure.figures.clouds import Cloud, Purified, cluster_cloud, kept_cloud, rank_cloud, share_cloud
from gspure.figures.panels import show
from gspure.figures.plates import PAGE_WIDTH, PICTURE_WIDTH, portraits, write_plate
from gspure.figures.probe import gl_problem
from gspure.figures.viewer import write_viewer
from gspure.figures.viewpoint import MAX_POINTS, choose, fitted, thinned, world_axes
from gspure.files import Float32, Int32, UInt8, filling, write_json
from gspure.model import Gaussians
from gspure.model.gaussians import COLOUR, CORE
from gspure.opencl.device import Device
from gspure.progress import percent, warn
from gspure.renderer import Renderer

CAPTIONS: Final = "captions.json"  # beside the figures: the caption of each by its file's name
_PLATE: Final = ("model", "message before pruning", "rank of the weight", "message after pruning")
_SPLATS: Final = ("model", "clusters", "pruned rows alone")
_WIDEST: Final = 640  # pixels of a view of splats
_FAINT: Final = -2.0  # logit of the highest opacity of rows outside clusters
_WHITE: Final = (1.0, 1.0, 1.0)
_RANKS: Final = (
    "Rank: the order by τ_c times the mean weight of the cluster or, outside clusters, τ_n times the weight. GSPure "
    "prunes the lowest ranks."
)


class Drawing(NamedTuple):
    """A figure before it is drawn: to a file of this name in a folder."""

    name: str
    caption: str
    draw: Callable[[Path], object]


def draw_model(
    folder: Path,
    model: Purified,
    cameras: Sequence[Camera] = (),
    device: Device | None = None,
    *,
    viewer: bool = True,
) -> dict[str, str]:
    """Draw all figures of a model, and return the caption of each by the name of its file.

    These are ``splats``, if the model has colours and views; ``weights``; and the clouds ``clusters``, ``ranks`` and
    ``kept``, of a model with a message also ``hidden`` and ``purification``, which need OpenGL. Their captions stand in
    `CAPTIONS`. For a report, there are also the data of its 3-D `viewer` in ``viewer.json``, and ``weights.svg``. What
    cannot be drawn is left out with a warning.
    """
    captions: dict[str, str] = {}
    with filling(folder) as place:
        if viewer:
            sh_dc = model.public.model.columns(*COLOUR) if model.public.model.sh_degree >= 0 else None
            write_viewer(place / "viewer.json", model, world_axes(model.means, cameras), sh_dc)
        for name, caption, draw in _drawings(model, cameras, device, vector=viewer):
            try:
                draw(place / name)
                captions[name] = caption
            except Exception as error:  # noqa: BLE001 - plotting libraries raise many types
                warn(f"{folder / name}: not drawn: {' '.join(str(error).split()) or type(error).__name__}")
        write_json(place / CAPTIONS, captions)
    return captions


def _drawings(model: Purified, cameras: Sequence[Camera], device: Device | None, *, vector: bool) -> Iterator[Drawing]:
    is_visible = bool(cameras) and model.public.visible
    if is_visible:
        yield _splats(model, cameras, device)
    yield _histogram(model, vector=vector)
    if problem := gl_problem():
        warn(f"point clouds are not drawn: {problem}")
        return
    eye = choose(model.means, cameras)
    thin = f" A random {MAX_POINTS:,} of them are drawn." if len(model.means) > MAX_POINTS else ""
    listed = [*_clouds(model)]

    @cache
    def pictures() -> list[UInt8]:
        rows = thinned(len(model.means))
        return portraits([cloud.subset(rows) for _, cloud, _ in listed], fitted(eye, PICTURE_WIDTH))

    def draw_cloud(index: int, path: Path) -> None:
        write_plate(path, [pictures()[index]], [listed[index][1]])

    def draw_purification(before: Cloud, path: Path) -> None:
        ranked = rank_cloud(model.means, model.ranks)
        clouds = [cloud.subset(thinned(len(cloud))) for cloud in (before, ranked, before.subset(~model.pruned))]
        camera = fitted(eye, PAGE_WIDTH // (len(clouds) + is_visible))
        shown = [*portraits(clouds[:2], camera), *portraits(clouds[2:], camera)]
        if is_visible:
            render = model.public.scene(device, _WHITE)
            shown.insert(0, np.rint(255 * render(camera).clip(0, 1)).astype(np.uint8))
            clouds.insert(0, Cloud(model.means[:0], np.empty((0, 3), np.uint8)))
        write_plate(path, shown, clouds, _PLATE[-len(clouds) :])

    for index, (name, _, caption) in enumerate(listed):
        yield Drawing(f"{name}.png", caption + thin, partial(draw_cloud, index))
    if model.hidden is not None:
        before = share_cloud(model.means, model.weights, model.hidden)
        caption = " ".join([_message_caption(model, model.hidden), _RANKS, _pruned_weight(model, model.hidden)])
        yield Drawing("purification.png", caption + thin, partial(draw_purification, before))


def _clouds(model: Purified) -> Iterator[tuple[str, Cloud, str]]:
    means, labels, pruned = model.means, model.labels, model.pruned
    clusters = int(labels.max(initial=NOISE_LABEL)) + 1
    caption = (
        f"{clusters} cluster{'s' * (clusters != 1)} of the {len(means):,} {model.rows}, by HDBSCAN on position, "
        "opacity and weight. The legend gives their shares. Kept clusters are pale, noise is grey."
    )
    yield "clusters", cluster_cloud(means, labels, pruned), caption
    yield "ranks", rank_cloud(means, model.ranks), _RANKS
    yield "kept", kept_cloud(means, pruned), f"{pruned.sum():,} of {len(means):,} {model.rows} are pruned."
    if model.hidden is not None:
        yield "hidden", share_cloud(means, model.weights, model.hidden), _message_caption(model, model.hidden)


def _message_caption(model: Purified, hidden: Float32) -> str:
    caption = (
        f"Share of the message in the weight of the {model.rows}: h / (h + ω), where h is the weight in views of the "
        "message, and ω that in views of the scene; grey where both are 0."
    )
    if np.allclose(hidden, model.weights):
        caption += " Both weights are equal everywhere: message and scene share all Gaussians."
    return caption


def _pruned_weight(model: Purified, hidden: Float32) -> str:
    if not hidden.any():
        return "No row holds weight of the message."
    message, scene = (
        float(values[model.pruned].sum(dtype=np.float64)) / (float(values.sum(dtype=np.float64)) or 1)
        for values in (hidden, model.weights)
    )
    return f"Pruning removes {percent(message)} of the weight in the message and {percent(scene)} of that in the scene."


def _histogram(model: Purified, *, vector: bool) -> Drawing:
    zero, rows = percent(float(np.mean(model.weights == 0))), model.rows
    caption = (
        f"Histogram of the weights ω, with mean ω̄. {zero} are 0: these {rows} contribute to no pixel. GSPure prunes "
        f"clusters if their mean weight is below ω̄/{model.tau_c:g}, and {rows} in no cluster if their weight is below "
        f"ω̄/{model.tau_n:g}."
    )
    values = (model.weights, model.pruned, model.tau_c, model.tau_n, rows)
    return Drawing("weights.png", caption, lambda path: write_weight_histogram(path, *values, vector=vector))


def _splats(model: Purified, cameras: Sequence[Camera], device: Device | None) -> Drawing:
    """Return the figure of renders: a row of pictures for each of two views, held-out ones if there are any."""
    views = split(cameras)[1] or [*cameras]
    shown = views[:: -(-len(views) // 2)]
    caption = (
        f"{' and '.join(view.name for view in shown)}, from left to right: the model; its clusters, pale if GSPure "
        "keeps them, and noise in faint grey; only the rows that GSPure prunes."
    )

    def draw(path: Path) -> None:
        public, pruned = model.public, model.pruned
        colours = (cluster_cloud(model.means, model.labels, pruned).colours / 255).astype(np.float32)
        alone = public.with_model(public.model[pruned]).scene(device, _WHITE)
        aspect = sum(view.height / view.width for view in shown)
        with style.page(path, style.PAGE, aspect * style.PAGE / len(_SPLATS) + 0.06 * len(shown) + 0.26) as figure:
            grid = figure.subplots(len(shown), len(_SPLATS), squeeze=False)
            for axes, title in zip(grid[0], _SPLATS, strict=True):
                axes.set_title(title, pad=4, fontsize=11)
            for view, row in zip(shown, grid, strict=True):
                width = min(view.width, _WIDEST)
                camera = view.resized(width, max(round(view.height * width / view.width), 1))
                show(row[0], public.scene(device)(camera), "")
                gaussians, rows = public.gaussians(camera)
                show(row[1], _clusters(gaussians, model.labels[rows], colours[rows], camera, device), "")
                show(row[2], alone(camera), "")

    return Drawing("splats.png", caption, draw)


def _clusters(gaussians: Gaussians, labels: Int32, colours: Float32, camera: Camera, device: Device | None) -> Float32:
    """Return a picture in `colours` [K,3], from a copy without the harmonics, which are most of a model."""
    logits = gaussians.table["opacity"]
    faint = np.where(labels == NOISE_LABEL, np.minimum(logits, _FAINT), logits).astype(np.float32)
    shapes = Gaussians(repack_fields(gaussians.table[[*CORE]])).with_columns({"opacity": faint})
    return Renderer(shapes, device).feature_map(camera, colours, _WHITE)
