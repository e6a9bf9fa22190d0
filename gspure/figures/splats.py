"""Views of a model by our renderer: as it is, its clusters, and the pruned rows alone."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.lib.recfunctions import repack_fields

from gspure.cameras.camera import Camera, split
from gspure.constants import NOISE_LABEL
from gspure.figures import style
from gspure.figures.clouds import cluster_cloud
from gspure.figures.gallery import Drawing
from gspure.figures.panels import show
from gspure.files import Bools, Float32, Int32
from gspure.model import Gaussians
from gspure.model.gaussians import CORE
from gspure.opencl.device import Device
from gspure.public_model import PublicModel
from gspure.renderer import Renderer

TITLES: Final = ("model", "clusters", "pruned rows alone")
_TITLE: Final = 11  # points, legible on a phone
_WIDEST: Final = 640  # pixels of a view
_FAINT: Final = -2.0  # logit of the highest opacity of rows outside clusters
_WHITE: Final = (1.0, 1.0, 1.0)


def splats(
    folder: Path,
    model: PublicModel,
    cameras: Sequence[Camera],
    labels: Int32,
    pruned: Bools,
    device: Device | None = None,
) -> Drawing:
    """Return the figure ``splats.png``: a row of pictures for each of two views, held-out ones if there are any.

    `labels` [K] and `pruned` [K] are of the rows. Rows outside clusters are faint; clusters have the colours of
    `gspure.figures.clouds.cluster_cloud`.
    """
    views = split(cameras)[1] or [*cameras]
    path, shown = folder / "splats.png", views[:: -(-len(views) // 2)]
    names = " and ".join(view.name for view in shown)
    caption = (
        f"{names}, from left to right: the model; its clusters, pale if GSPure keeps them, and noise in faint grey; "
        "only the rows that GSPure prunes."
    )

    def draw() -> None:
        colours = (cluster_cloud(model.model.means, labels, pruned).colours / 255).astype(np.float32)
        alone = model.with_model(model.model[pruned]).scene(device, _WHITE)
        aspect = sum(view.height / view.width for view in shown)
        with style.page(path, style.PAGE, aspect * style.PAGE / len(TITLES) + 0.06 * len(shown) + 0.26) as figure:
            grid = figure.subplots(len(shown), len(TITLES), squeeze=False)
            for axes, title in zip(grid[0], TITLES, strict=True):
                axes.set_title(title, pad=4, fontsize=_TITLE)
            for view, row in zip(shown, grid, strict=True):
                width = min(view.width, _WIDEST)
                camera = view.resized(width, max(round(view.height * width / view.width), 1))
                show(row[0], model.scene(device)(camera), "")
                gaussians, rows = model.gaussians(camera)
                show(row[1], _clusters(gaussians, labels[rows], colours[rows], camera, device), "")
                show(row[2], alone(camera), "")

    return Drawing(path, caption, draw)


def _clusters(gaussians: Gaussians, labels: Int32, colours: Float32, camera: Camera, device: Device | None) -> Float32:
    """Return a picture in `colours` [K,3], from a copy without the harmonics, which are most of a model."""
    logits = gaussians.table["opacity"]
    faint = np.where(labels == NOISE_LABEL, np.minimum(logits, _FAINT), logits).astype(np.float32)
    shapes = Gaussians(repack_fields(gaussians.table[[*CORE]])).with_columns({"opacity": faint})
    return Renderer(shapes, device).feature_map(camera, colours, _WHITE)
