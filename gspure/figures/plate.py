"""A figure of point clouds side by side, each picture above its legend."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from gspure.figures import style
from gspure.figures.clouds import Cloud, Legend, Scale
from gspure.files import UInt8

if TYPE_CHECKING:
    from matplotlib.figure import SubFigure

PICTURE_WIDTH: Final = round(style.COLUMN * style.DPI)  # width in pixels of a picture in a column, without resampling
PAGE_WIDTH: Final = round(style.PAGE * style.DPI)  # width in pixels of all pictures across the page

_ROW: Final = 0.15  # height of a row of the legend, inches
_TITLE: Final = 0.2  # height of a title


def write_plate(path: Path, pictures: Sequence[UInt8], clouds: Sequence[Cloud], titles: Sequence[str] = ()) -> None:
    """Write pictures of clouds, all of one size, each with its legend or scale and an optional title, as a PNG."""
    height, width = pictures[0].shape[:2]
    above, below = _TITLE if titles else 0.0, _ROW * (max(len(cloud.legend) or 2 for cloud in clouds) + 0.7)
    total = above + height / style.DPI + below
    with style.page(path, len(pictures) * width / style.DPI, total, layout=None) as figure:
        parts = figure.subfigures(1, len(pictures), squeeze=False, wspace=0)[0]
        for part, picture, cloud in zip(parts, pictures, clouds, strict=True):
            axes = part.add_axes((0, below / total, 1, height / style.DPI / total))
            axes.imshow(picture, interpolation="none", aspect="auto")
            axes.set_axis_off()
            if cloud.scale:
                _draw_scale(part, cloud.scale, below / total)
            else:
                _draw_legend(part, cloud.legend, below / total)
        for part, title in zip(parts, titles, strict=False):
            part.text(0.5, 1 - 0.5 * above / total, title, ha="center", va="center")


def _draw_legend(figure: SubFigure, legend: Legend, share: float) -> None:
    from matplotlib.lines import Line2D

    for i, row in enumerate(legend):
        dots = [Line2D([], [], marker="o", markersize=4, linewidth=0, color=c, label=label) for label, c in row]
        place = (0.5, share * (len(legend) - i - 0.3) / len(legend))
        figure.legend(handles=dots, loc="center", bbox_to_anchor=place, ncols=len(row), borderpad=0, fontsize=5.7)


def _draw_scale(figure: SubFigure, scale: Scale, share: float) -> None:
    axes = figure.add_axes((0.06, 0.6 * share, 0.88, 0.18 * share))
    axes.imshow(scale.colours[None], aspect="auto")
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
    last = len(scale.colours) - 1
    axes.set_xticks([0, last / 2, last], list(scale.words))
    axes.get_xticklabels()[0].set_horizontalalignment("left")
    axes.get_xticklabels()[-1].set_horizontalalignment("right")
    axes.tick_params(length=0, pad=2)
