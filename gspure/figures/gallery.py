"""All figures of one model and its purification."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Final

import numpy as np
from numpy.lib.recfunctions import repack_fields

from gspure.arrays import Bools, Float32, Float64, UInt8
from gspure.cameras.camera import Camera
from gspure.cameras.splits import split
from gspure.constants import NOISE_LABEL
from gspure.figures.charts import draw_weights
from gspure.figures.clouds import Colouring, Purified, by_reason
from gspure.figures.panels import Tile, write_tiles
from gspure.figures.plates import PAGE_WIDTH, PICTURE_WIDTH, opengl_works, portraits, write_plate
from gspure.figures.viewpoint import choose_camera, fitted, foremost, framed, overview, world_axes
from gspure.files import filling, write_json
from gspure.images import levels
from gspure.model import Gaussians
from gspure.model.gaussians import CORE
from gspure.opencl.device import Device
from gspure.progress import warn
from gspure.public_model import PublicModel
from gspure.renderer import WHITE, Renderer
from gspure.text import percent

PLATES: Final = ("purification", "separation")  # figures of a model with a message: the layouts of Fig. 1 and Fig. 6
CAPTIONS: Final = "captions.json"  # beside the figures: their captions, by file name
_COLOURING_OF: Final = {"clusters": "cluster", "ranks": "rank", "kept": "pruned"}  # figures of one point cloud
_NO_OPENGL: Final = (
    "point clouds are not drawn: OpenGL does not work: `make gl` in a checkout of gspure, or `sudo apt-get install "
    "libegl1 libgl1-mesa-dri`"
)
_PURIFICATION: Final = ("message", "published model", "rank of the weight", "message after GSPure")
_SEPARATION: Final = ("message in the model", "clusters of GSPure", "message after GSPure")
_BLOCKS: Final = 16  # blocks across a picture; a name stands in the block with most of its points
_SPLATS: Final = ("model", "clusters", "pruned rows")
_WIDEST: Final = 640  # pixels of a view of splats
_FAINT: Final = -2.0  # logit of the highest opacity of noise
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
    """Draw the centres of a model from outside as a PNG, rows in masks [K] in colours; without OpenGL, only warn."""
    if not opengl_works():
        warn(_NO_OPENGL)
        return
    finite = np.isfinite(model.means).all(axis=1)
    means = model.means[finite]
    colouring = by_reason({name: mask[finite] for name, mask in masks.items()})
    camera = fitted(overview(means, world_axes(means, cameras)), PICTURE_WIDTH)
    write_plate(path, portraits(means, [colouring.colours], camera), [colouring])


def _clouds(model: Purified, cameras: Sequence[Camera], device: Device | None) -> dict[str, Draw]:
    """Return how to draw the point clouds, by figure: one for each colouring, and with a message both `PLATES`."""
    view = choose_camera(model.means, cameras)
    camera = fitted(view, PICTURE_WIDTH)

    @cache
    def pictures() -> dict[str, UInt8]:
        """Draw all colourings of one cloud, which is uploaded once."""
        colours = [model.colourings[name].colours for name in _COLOURING_OF.values()]
        return dict(zip(_COLOURING_OF.values(), portraits(model.means, colours, camera), strict=True))

    def draw_cloud(figure: str, path: Path) -> str:
        name = _COLOURING_OF[figure]
        colouring = model.colourings[name]
        write_plate(path, [pictures()[name]], [colouring], names=[_places(model.means, colouring, camera)])
        return _caption(figure, model)

    drawings: dict[str, Draw] = {figure: partial(draw_cloud, figure) for figure in _COLOURING_OF}
    if model.hidden is not None:
        drawings["separation"] = partial(_draw_separation, model, model.hidden, view)
    if model.extracted and model.public.visible:
        drawings["purification"] = partial(_draw_purification, model, model.extracted, view, device)
        del drawings["ranks"]
    return drawings


def _draw_separation(model: Purified, hidden: Float32, view: Camera, path: Path) -> str:
    """Draw the message among all rows, the clusters, and the message among the rows left: the paper's Fig. 6."""
    camera = fitted(view, PAGE_WIDTH // 3)
    kept = ~model.pruned
    message = model.colourings["message"]
    clusters = model.colourings["cluster"]
    pictures = portraits(model.means, [message.colours, clusters.colours], camera)
    pictures += portraits(model.means[kept], [message.colours[kept]], camera)
    names = [{}, _places(model.means, clusters, camera), {}]
    write_plate(path, pictures, [message, clusters, message], _SEPARATION, names)
    shared = ""
    if np.allclose(hidden, model.weights):
        shared = " Both are equal everywhere: message and scene share all rows."
    return (
        f"Left and right: share of the message in the weight of the {model.row_kind}: h / (h + ω), where h is the "
        "weight in views of the message, and ω that in views of the scene; grey where both are 0."
        f"{shared} Pruning removes {_pruned_share(hidden, model.pruned)} of the weight in the message and "
        f"{_pruned_share(model.weights, model.pruned)} of that in the scene."
    )


def _pruned_share(weights: Float32, pruned: Bools) -> str:
    """Return the share of the weight [K] on pruned rows, in percent."""
    values = weights.astype(np.float64)
    return percent(float(values[pruned].sum() / (values.sum() or 1)))


def _draw_purification(model: Purified, extracted: Extract, view: Camera, device: Device | None, path: Path) -> str:
    """Draw the extracted message, the model, the ranks, and what is then extracted: the paper's Fig. 1."""
    from PIL import Image

    public = model.public
    purified = public.with_model(public.model[~model.pruned])
    messages = [Image.fromarray(levels(extracted(each))) for each in (public, purified)]
    width = PAGE_WIDTH // 4
    camera = framed(view, width, round(width * messages[0].height / messages[0].width))
    before, after = (np.asarray(message.resize((camera.width, camera.height))) for message in messages)
    ranks = model.colourings["rank"]
    pictures = [
        before,
        levels(public.scene(device, WHITE)(camera)),
        portraits(model.means, [ranks.colours], camera)[0],
        after,
    ]
    keys = [
        _text_key("extracted with the key"),
        _text_key(f"{len(public.model):,} {model.row_kind}"),
        ranks,
        _text_key(f"{len(purified.model):,} {model.row_kind}"),
    ]
    write_plate(path, pictures, keys, _PURIFICATION)
    return f"The message that its owner extracts before and after pruning, and between them the model. {_RANKS}"


def _text_key(text: str) -> Colouring:
    """Return a legend of plain text, for a picture without coloured points."""
    return Colouring(np.empty((0, 3), np.uint8), (((text, "none"),),))


def _places(means: Float32, colouring: Colouring, camera: Camera) -> dict[str, Float64]:
    """Return the pixel of each name of a colouring: where most of its points are visible."""
    if not colouring.named:
        return {}
    rows, pixels = foremost(means, camera)
    places = {}
    for name, named_rows in colouring.named.items():
        visible = pixels[np.isin(rows, named_rows)]
        grid = visible // (camera.width / _BLOCKS)
        blocks, block, count = np.unique(grid, axis=0, return_inverse=True, return_counts=True)
        if len(blocks):
            crowd = visible[block.ravel() == count.argmax()]
            places[name] = crowd[np.linalg.norm(crowd - crowd.mean(axis=0), axis=1).argmin()]
    return places


def _caption(figure: str, model: Purified) -> str:
    """Return the caption of the figure of one point cloud."""
    if figure == "ranks":
        return _RANKS
    if figure == "kept":
        return f"{model.pruned.sum():,} of {len(model.means):,} {model.row_kind} are pruned."
    clusters = int(model.labels.max(initial=NOISE_LABEL)) + 1
    noun = "cluster" if clusters == 1 else "clusters"
    return (
        f"{clusters} {noun} of the {len(model.means):,} {model.row_kind}, by HDBSCAN on position, opacity and weight. "
        "The legend gives their shares, and the largest a number. Kept clusters are pale, noise is light grey."
    )


def _draw_splats(model: Purified, cameras: Sequence[Camera], device: Device | None, path: Path) -> str:
    """Draw a row of renders for each of two views, held-out ones if there are any."""
    views = split(cameras)[1] or [*cameras]
    step = -(-len(views) // 2)
    shown = views[::step]
    public = model.public
    render_pruned = public.with_model(public.model[model.pruned]).scene(device, WHITE)
    colours = (model.colourings["cluster"].colours / 255).astype(np.float32)
    uploaded = None
    rows = []
    for view in shown:
        width = min(view.width, _WIDEST)
        camera = view.resized(width, max(round(view.height * width / view.width), 1))
        gaussians, owners = public.gaussians(camera)
        if gaussians is not uploaded:
            uploaded = gaussians
            faint = Renderer(_with_faint_noise(gaussians, model.labels[owners] == NOISE_LABEL), device)
        clusters = faint.feature_map(camera, colours[owners], WHITE)
        rows.append([Tile(public.scene(device)(camera)), Tile(clusters), Tile(render_pruned(camera))])
    write_tiles(path, _SPLATS, rows)
    return (
        f"{' and '.join(view.name for view in shown)}, from left to right: the model; its clusters, pale if GSPure "
        "keeps them, and noise in faint grey; only the rows that GSPure prunes."
    )


def _with_faint_noise(gaussians: Gaussians, is_noise: Bools) -> Gaussians:
    """Return the Gaussians, noise [N] faint, without spherical harmonics, which are most of a model."""
    logits = gaussians.table["opacity"]
    faint = np.where(is_noise, np.minimum(logits, _FAINT), logits).astype(np.float32)
    return Gaussians(repack_fields(gaussians.table[[*CORE]])).with_columns({"opacity": faint})
