"""All figures of one model and its purification."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.lib.recfunctions import repack_fields

from gspure.arrays import Bools, Float32, Float64, Int32, UInt8
from gspure.cameras.camera import Camera
from gspure.cameras.splits import split
from gspure.constants import NOISE_LABEL
from gspure.figures.charts import draw_weights
from gspure.figures.clouds import Colouring, Purified, by_reason
from gspure.figures.panels import Tile, write_tiles
from gspure.figures.plates import PAGE_WIDTH, PICTURE_WIDTH, opengl_works, portraits, write_plate
from gspure.figures.viewpoint import choose, fitted, foremost, framed, overview, world_axes
from gspure.files import filling, write_json
from gspure.images import levels
from gspure.model import Gaussians
from gspure.model.gaussians import CORE
from gspure.opencl.device import Device
from gspure.progress import warn
from gspure.public_model import PublicModel
from gspure.renderer import Renderer
from gspure.text import percent

PLATES: Final = ("purification", "separation")  # figures of a model with a message: the layouts of Fig. 1 and Fig. 6
CAPTIONS: Final = "captions.json"  # beside the figures: the caption of each by its file's name
_NO_OPENGL: Final = (
    "point clouds are not drawn: OpenGL does not work: `make gl` in a checkout of gspure, or `sudo apt-get install "
    "libegl1 libgl1-mesa-dri`"
)
_PURIFICATION: Final = ("message", "published model", "rank of the weight", "message after GSPure")
_SEPARATION: Final = ("message in the model", "clusters of GSPure", "message after GSPure")
_BLOCKS: Final = 16  # across a picture, in which the points of a cluster are counted
_SPLATS: Final = ("model", "clusters", "pruned rows")
_WIDEST: Final = 640  # pixels of a view of splats
_FAINT: Final = -2.0  # logit of the highest opacity of rows outside clusters
_WHITE: Final = (1.0, 1.0, 1.0)
_RANKS: Final = (
    "Rank: the order by τ_c times the mean weight of the cluster or, outside clusters, τ_n times the weight. GSPure "
    "prunes the lowest ranks."
)

Extract = Callable[[PublicModel], Float32]
Draw = Callable[[Path], str]
"""Draw a figure and return its caption."""


def draw_model(
    folder: Path, model: Purified, cameras: Sequence[Camera] = (), device: Device | None = None
) -> dict[str, str]:
    """Draw all figures of a model, and return the caption of each by the name of its file.

    These are ``splats``, if the model has colours and views; ``weights``; and, with OpenGL, the clouds ``clusters``,
    ``kept`` and ``ranks``, or for a model with a message the plates ``separation`` and ``purification``. Their captions
    stand in `CAPTIONS`. What cannot be drawn is left out with a warning.
    """
    drawings: dict[str, Draw] = {"weights": partial(draw_weights, model=model)}
    if cameras and model.public.visible:
        drawings = {"splats": partial(_draw_splats, model, cameras, device), **drawings}
    if opengl_works():
        drawings |= _clouds(model, cameras, device)
    else:
        warn(_NO_OPENGL)
    captions: dict[str, str] = {}
    with filling(folder) as place:
        for name, draw in drawings.items():
            file = f"{name}.png"
            try:
                captions[file] = draw(place / file)
            except Exception as error:  # noqa: BLE001 - plotting libraries raise many types
                warn(f"{folder / file}: not drawn: {' '.join(str(error).split()) or type(error).__name__}")
        write_json(place / CAPTIONS, captions)
    return captions


def draw_rows(path: Path, model: Gaussians, masks: Mapping[str, Bools], cameras: Sequence[Camera] = ()) -> None:
    """Draw the centres of a model from outside as a PNG, those of masks [K] in colours; warn without OpenGL."""
    if not opengl_works():
        warn(_NO_OPENGL)
        return
    finite = np.isfinite(model.means).all(axis=1)
    means, key = model.means[finite], by_reason({name: mask[finite] for name, mask in masks.items()})
    eye = fitted(overview(means, world_axes(means, cameras)), PICTURE_WIDTH)
    write_plate(path, portraits(means, [key.colours], eye), [key])


def _clouds(model: Purified, cameras: Sequence[Camera], device: Device | None) -> dict[str, Draw]:
    """Return the figures of point clouds by name: one for each colouring, and with a message all of them in a row."""
    eye, colourings, shown = choose(model.means, cameras), model.colourings, _captions(model)

    @cache
    def pictures() -> dict[str, UInt8]:
        names = [name for name, _ in shown.values()]
        images = portraits(model.means, [colourings[name].colours for name in names], fitted(eye, PICTURE_WIDTH))
        return dict(zip(names, images, strict=True))

    def draw_cloud(name: str, caption: str, path: Path) -> str:
        colouring, camera = colourings[name], fitted(eye, PICTURE_WIDTH)
        write_plate(path, [pictures()[name]], [colouring], names=[_places(model.means, colouring, camera)])
        return caption

    drawings: dict[str, Draw] = {name: partial(draw_cloud, *facts) for name, facts in shown.items()}
    if model.hidden is not None:
        drawings["separation"] = partial(_draw_separation, model, model.hidden, eye)
    if model.extracted and model.public.visible:
        drawings["purification"] = partial(_draw_purification, model, model.extracted, eye, device)
        del drawings["ranks"]
    return drawings


def _draw_separation(model: Purified, hidden: Float32, eye: Camera, path: Path) -> str:
    """Draw the message among all rows, the clusters, and the message among the rows left: the paper's Fig. 6."""
    camera, kept = fitted(eye, PAGE_WIDTH // 3), ~model.pruned
    keys = [model.colourings[name] for name in ("message", "cluster", "message")]
    row = portraits(model.means, [key.colours for key in keys[:2]], camera)
    row += portraits(model.means[kept], [keys[2].colours[kept]], camera)
    write_plate(path, row, keys, _SEPARATION, [{}, _places(model.means, keys[1], camera), {}])
    weights = [values.astype(np.float64) for values in (hidden, model.weights)]
    removed = (percent(float(w[~kept].sum() / (w.sum() or 1))) for w in weights)
    pruning = "Pruning removes {} of the weight in the message and {} of that in the scene.".format(*removed)
    shared = " Both are equal everywhere: message and scene share all rows." * np.allclose(hidden, model.weights)
    return (
        f"Left and right: share of the message in the weight of the {model.rows}: h / (h + ω), where h is the weight "
        f"in views of the message, and ω that in views of the scene; grey where both are 0.{shared} {pruning}"
    )


def _draw_purification(model: Purified, extracted: Extract, eye: Camera, device: Device | None, path: Path) -> str:
    """Draw the extracted message, the model, the ranks, and what is then extracted: the paper's Fig. 1."""
    from PIL import Image

    public = model.public
    left = public.with_model(public.model[~model.pruned])
    messages = [Image.fromarray(levels(extracted(each))) for each in (public, left)]
    width = PAGE_WIDTH // 4
    camera = framed(eye, width, round(width * messages[0].height / messages[0].width))
    before, after = (np.asarray(image.resize((camera.width, camera.height))) for image in messages)
    ranks = portraits(model.means, [model.colourings["rank"].colours], camera)
    empty = np.empty((0, 3), np.uint8)
    counts = [f"{len(each.model):,} {model.rows}" for each in (public, left)]
    said = [Colouring(empty, (((text, "none"),),)) for text in ("extracted with the key", *counts)]
    keys = [said[0], said[1], model.colourings["rank"], said[2]]
    row = [before, levels(public.scene(device, _WHITE)(camera)), *ranks, after]
    write_plate(path, row, keys, _PURIFICATION)
    return f"The message that its owner extracts before and after pruning, and between them the model. {_RANKS}"


def _places(means: Float32, colouring: Colouring, camera: Camera) -> dict[str, Float64]:
    """Return the pixels of a colouring's names: where most of their points are seen."""
    if not colouring.named:
        return {}
    rows, pixels = foremost(means, camera)
    places = {}
    for name, its_rows in colouring.named.items():
        seen = pixels[np.isin(rows, its_rows)]
        grid = seen // (camera.width / _BLOCKS)
        blocks, block, count = np.unique(grid, axis=0, return_inverse=True, return_counts=True)
        if len(blocks):
            crowd = seen[block.ravel() == count.argmax()]
            places[name] = crowd[np.linalg.norm(crowd - crowd.mean(axis=0), axis=1).argmin()]
    return places


def _captions(model: Purified) -> dict[str, tuple[str, str]]:
    """Return the colouring and the caption of every figure of one point cloud."""
    clusters = int(model.labels.max(initial=NOISE_LABEL)) + 1
    of_clusters = (
        f"{clusters} cluster{'s' * (clusters != 1)} of the {len(model.means):,} {model.rows}, by HDBSCAN on position, "
        "opacity and weight. The legend gives their shares, and the largest a number. Kept clusters are pale, "
        "noise is light grey."
    )
    of_mask = f"{model.pruned.sum():,} of {len(model.means):,} {model.rows} are pruned."
    return {"clusters": ("cluster", of_clusters), "ranks": ("rank", _RANKS), "kept": ("pruned", of_mask)}


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
