"""The same views in several renderings, side by side, each labelled with its PSNR."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from gspure.errors import InputError
from gspure.evaluation.metrics import psnr
from gspure.evaluation.names import display_name
from gspure.figures import style
from gspure.files import Float32
from gspure.images import read_image
from gspure.progress import decimal

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Image = Float32

GAIN: Final = 5  # factor of the displayed differences


def write_panels(
    path: Path, columns: Mapping[str, Mapping[str, Image]], views: Sequence[str], *, difference: bool
) -> None:
    """Write rows of views and columns of renderings as a PNG, as wide as a page.

    Every column has all `views`; the first is the reference of the PSNR. `difference` adds a column with `GAIN` times
    the absolute difference between the last column and the first.
    """
    titles, renderings = list(columns), list(columns.values())
    reference, last = renderings[0], renderings[-1]
    if difference:
        titles.append(f"|difference| × {GAIN}")
    width = style.PAGE / len(titles)
    height, breadth = np.shape(reference[views[0]])[:2]
    rows = len(views) * (width * height / breadth + 0.14)
    with style.page(path, style.PAGE, rows + 0.2) as figure:
        grid = figure.subplots(len(views), len(titles), squeeze=False)
        for axes, title in zip(grid[0], titles, strict=True):
            axes.set_title(display_name(title), pad=3)
        for view, row in zip(views, grid, strict=True):
            for axes, rendering in zip(row, renderings, strict=False):
                label = view if rendering is reference else f"{decimal(psnr(reference[view], rendering[view]))} dB"
                show(axes, rendering[view], label)
            if difference:
                show(row[-1], GAIN * np.abs(last[view] - reference[view]), "")


def draw_before_after(path: Path, folders: Mapping[str, Path], rows: int = 3) -> str:
    """Draw some views of folders of ``VIEW.png`` by title, the reference first, as a PNG; return the caption."""
    views = common_views(folders.values())
    chosen = [views[i] for i in np.unique(np.linspace(0, len(views) - 1, rows).round().astype(int))]
    images = {title: {v: read_image(folder / f"{v}.png") for v in chosen} for title, folder in folders.items()}
    write_panels(path, images, chosen, difference=True)
    first, *_, last = map(display_name, folders)
    return (
        f"{len(chosen)} of {len(views)} views, with their PSNR against {first}. Last column: {GAIN} times the absolute "
        f"difference between {last} and {first}."
    )


def common_views(folders: Iterable[Path]) -> list[str]:
    """Return the sorted names of the views in all folders, or raise `InputError` if there is none."""
    folders = list(folders)
    views = sorted(set.intersection(*({path.stem for path in folder.glob("*.png")} for folder in folders)))
    if not views:
        raise InputError(folders[-1], "*.png", expected=f"a view of {folders[0]}", found="none")
    return views


def show(axes: Axes, image: Image, label: str) -> None:
    """Draw an image [H,W,3] without axes, with a label below."""
    axes.imshow(np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8))
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
    axes.set_xlabel(label, labelpad=2)
