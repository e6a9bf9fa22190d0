"""All figures of one model and its purification."""

from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.lib.recfunctions import repack_fields

from gspure.cameras.camera import Camera, split
from gspure.constants import NOISE_LABEL
from gspure.figures.charts import draw_weights
from gspure.figures.clouds import Colouring, Purified
from gspure.figures.panels import Tile, as_bytes, write_tiles
from gspure.figures.plates import PAGE_WIDTH, PICTURE_WIDTH, opengl_renderer, portraits, write_plate
from gspure.figures.viewer import write_viewer
from gspure.figures.viewpoint import choose, fitted, project
from gspure.files import Float32, Int32, UInt8, filling, write_json
from gspure.model import Gaussians
from gspure.model.gaussians import CORE
from gspure.opencl.device import Device
from gspure.progress import percent, warn
from gspure.renderer import Renderer

CAPTIONS: Final = "captions.json"  # beside the figures: the caption of each by its file's name
_NO_OPENGL: Final = (
    "point clouds are not drawn: OpenGL does not work: `make gl` in a checkout of gspure, or `sudo apt-get install "
    "libegl1 libgl1-mesa-dri`"
)
_PLATE: Final = ("model", "message before pruning", "rank of the weight", "message after pruning")
_SPLATS: Final = ("model", "clusters", "pruned rows")
_WIDEST: Final = 640  # pixels of a view of splats
_FAINT: Final = -2.0  # logit of the highest opacity of rows outside clusters
_WHITE: Final = (1.0, 1.0, 1.0)
_RANKS: Final = (
    "Rank: the order by τ_c times the mean weight of the cluster or, outside clusters, τ_n times the weight. GSPure "
    "prunes the lowest ranks."
)

Draw = Callable[[Path], str]
"""Draw a figure and return its caption."""


def draw_model(
    folder: Path, model: Purified, cameras: Sequence[Camera] = (), device: Device | None = None, *, viewer: bool = True
) -> dict[str, str]:
    """Draw all figures of a model, and return the caption of each by the name of its file.

    These are ``splats``, if the model has colours and views; ``weights``; and the clouds ``clusters``, ``ranks`` and
    ``kept``, of a model with a message also ``hidden`` and ``purification``, which need OpenGL. Their captions stand in
    `CAPTIONS`, and the data of a report's 3-D `viewer` in ``view.json``. What cannot be drawn is left out with a
    warning.
    """
    drawings: dict[str, Draw] = {"weights": partial(draw_weights, model=model)}
    if cameras and model.public.visible:
        drawings = {"splats": partial(_draw_splats, model, cameras, device), **drawings}
    if opengl_renderer():
        drawings |= _clouds(model, cameras, device)
    else:
        warn(_NO_OPENGL)
    captions: dict[str, str] = {}
    with filling(folder) as place:
        if viewer:
            write_viewer(place / "view.json", model, cameras)
        for name, draw in drawings.items():
            file = f"{name}.png"
            try:
                captions[file] = draw(place / file)
            except Exception as error:  # noqa: BLE001 - plotting libraries raise many types
                warn(f"{folder / file}: not drawn: {' '.join(str(error).split()) or type(error).__name__}")
        write_json(place / CAPTIONS, captions)
    return captions


def _clouds(model: Purified, cameras: Sequence[Camera], device: Device | None) -> dict[str, Draw]:
    """Return the figures of point clouds by name: one for each colouring, and with a message all of them in a row."""
    eye, colourings, shown = choose(model.means, cameras), model.colourings, _captions(model)

    @cache
    def pictures() -> dict[str, UInt8]:
        names = [name for name, _ in shown.values()]
        images = portraits(model.means, [colourings[name].colours for name in names], fitted(eye, PICTURE_WIDTH))
        return dict(zip(names, images, strict=True))

    def draw_cloud(name: str, caption: str, path: Path) -> str:
        camera, names = fitted(eye, PICTURE_WIDTH), {}
        for text, rows in colourings[name].named.items():
            pixels = project(model.means[rows], camera)[0]
            from_middle = np.linalg.norm(pixels - np.nanmedian(pixels, axis=0), axis=1)
            names[text] = pixels[np.nanargmin(from_middle)]  # a point of the cluster, whatever its shape
        write_plate(path, [pictures()[name]], [colourings[name]], names=names)
        return caption

    def draw_purification(hidden: Float32, path: Path) -> str:
        has_render = bool(cameras) and model.public.visible
        camera, kept = fitted(eye, PAGE_WIDTH // (3 + has_render)), ~model.pruned
        message, rank = colourings["message"], colourings["rank"]
        row = portraits(model.means, [message.colours, rank.colours], camera)
        row += portraits(model.means[kept], [message.colours[kept]], camera)
        keys = [message, rank, message]
        if has_render:
            row.insert(0, as_bytes(model.public.scene(device, _WHITE)(camera)))
            keys.insert(0, Colouring(np.empty((0, 3), np.uint8)))
        write_plate(path, row, keys, _PLATE[-len(row) :])
        weights = [values.astype(np.float64) for values in (hidden, model.weights)]
        removed = (percent(float(w[~kept].sum() / (w.sum() or 1))) for w in weights)
        pruning = "Pruning removes {} of the weight in the message and {} of that in the scene.".format(*removed)
        return f"{shown['hidden'][1]} {_RANKS} {pruning}"

    drawings: dict[str, Draw] = {name: partial(draw_cloud, *facts) for name, facts in shown.items()}
    return drawings if model.hidden is None else {**drawings, "purification": partial(draw_purification, model.hidden)}


def _captions(model: Purified) -> dict[str, tuple[str, str]]:
    """Return the colouring and the caption of every figure of one point cloud."""
    clusters = int(model.labels.max(initial=NOISE_LABEL)) + 1
    of_clusters = (
        f"{clusters} cluster{'s' * (clusters != 1)} of the {len(model.means):,} {model.rows}, by HDBSCAN on position, "
        "opacity and weight. The legend gives their shares, and the largest a number. Kept clusters are pale, "
        "noise is light grey."
    )
    of_mask = f"{model.pruned.sum():,} of {len(model.means):,} {model.rows} are pruned."
    captions = {"clusters": ("cluster", of_clusters), "ranks": ("rank", _RANKS), "kept": ("pruned", of_mask)}
    of_message = (
        f"Share of the message in the weight of the {model.rows}: h / (h + ω), where h is the weight in views of the "
        "message, and ω that in views of the scene; grey where both are 0."
    )
    if model.hidden is not None:
        shared = " Both are equal everywhere: message and scene share all rows."
        captions["hidden"] = ("message", of_message + shared * np.allclose(model.hidden, model.weights))
    return captions


def _draw_splats(model: Purified, cameras: Sequence[Camera], device: Device | None, path: Path) -> str:
    """Draw a row of renders for each of two views, held-out ones if there are any."""
    views = split(cameras)[1] or [*cameras]
    shown = views[:: -(-len(views) // 2)]
    public, pruned = model.public, model.pruned
    colours = (model.colourings["cluster"].colours / 255).astype(np.float32)
    alone = public.with_model(public.model[pruned]).scene(device, _WHITE)
    rows = []
    for view in shown:
        width = min(view.width, _WIDEST)
        camera = view.resized(width, max(round(view.height * width / view.width), 1))
        gaussians, drawn = public.gaussians(camera)
        clusters = _clusters(gaussians, model.labels[drawn], colours[drawn], camera, device)
        rows.append([Tile(public.scene(device)(camera)), Tile(clusters), Tile(alone(camera))])
    write_tiles(path, _SPLATS, rows)
    return (
        f"{' and '.join(view.name for view in shown)}, from left to right: the model; its clusters, pale if GSPure "
        "keeps them, and noise in faint grey; only the rows that GSPure prunes."
    )


def _clusters(gaussians: Gaussians, labels: Int32, colours: Float32, camera: Camera, device: Device | None) -> Float32:
    """Return a picture in `colours` [K,3], from a copy without the harmonics, which are most of a model."""
    logits = gaussians.table["opacity"]
    faint = np.where(labels == NOISE_LABEL, np.minimum(logits, _FAINT), logits).astype(np.float32)
    shapes = Gaussians(repack_fields(gaussians.table[[*CORE]])).with_columns({"opacity": faint})
    return Renderer(shapes, device).feature_map(camera, colours, _WHITE)
