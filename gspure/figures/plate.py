"""A figure of one point cloud: the picture above its legend."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from gspure.figures import style
from gspure.figures.clouds import Cloud, Legend

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURE_WIDTH: Final = round(style.COLUMN * style.DPI)
"""Width in pixels at which a portrait is printed dot for dot."""

_ROW: Final = 0.15  # height of a row of the legend, inches


def write_plate(path: Path, picture: NDArray[np.uint8], cloud: Cloud) -> None:
    """Write the picture of a cloud, `PICTURE_WIDTH` wide, with its legend or scale as a PNG."""
    above = picture.shape[0] / style.DPI
    below = _ROW * ((len(cloud.legend) or 2) + 0.7)
    share = below / (above + below)
    with style.page(path, style.COLUMN, above + below, layout=None) as figure:
        axes = figure.add_axes((0, share, 1, 1 - share))
        axes.imshow(picture, interpolation="none", aspect="auto")
        axes.set_axis_off()
        if cloud.scale:
            _draw_scale(figure, cloud.scale, share)
        else:
            _draw_legend(figure, cloud.legend, share)


def _draw_legend(figure: Figure, legend: Legend, share: float) -> None:
    from matplotlib.lines import Line2D

    for i, row in enumerate(legend):
        dots = [Line2D([], [], marker="o", markersize=4, linewidth=0, color=c, label=label) for label, c in row]
        place = (0.5, share * (len(legend) - i - 0.3) / len(legend))
        figure.legend(handles=dots, loc="center", bbox_to_anchor=place, ncols=len(row), borderpad=0, fontsize=5.7)


def _draw_scale(figure: Figure, label: str, share: float) -> None:
    axes = figure.add_axes((0.25, 0.6 * share, 0.5, 0.18 * share))
    axes.imshow(np.linspace(0, 1, 256)[None], cmap=style.RANKS, aspect="auto")
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
    axes.set_xticks([0, 127.5, 255], ["lowest", label, "highest"])
    axes.tick_params(length=0, pad=2)
