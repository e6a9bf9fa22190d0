"""Grids of images with titles and labels: views before and after an attack, side by side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import ceil
from pathlib import Path
from textwrap import fill
from typing import Final, NamedTuple

import numpy as np

from gspure.errors import InputError
from gspure.evaluation.metrics import psnr
from gspure.evaluation.names import display_name
from gspure.figures import style
from gspure.files import Float32, UInt8
from gspure.images import read_image
from gspure.progress import decimal

Image = Float32

_COLUMNS: Final = 6  # at most in a block, so that their titles are legible on a page
_GAIN: Final = 5  # factor of the displayed differences
_TITLE: Final = 0.26  # height of titles, inches: two lines
_TITLE_WIDTH: Final = 16  # letters in a line of them
_LABEL: Final = 0.15  # height of a tile's label
_NAMES: Final = 0.16  # breadth of the rows' names
_PADDING: Final = 0.04  # beside each tile
_GAP: Final = 0.15  # between blocks


class Tile(NamedTuple):
    """An image [H,W,3] with a label below, and small print in place of its contents."""

    image: Image
    label: str = ""
    text: str = ""


def write_tiles(path: Path, titles: Sequence[str], rows: Sequence[Sequence[Tile]], names: Sequence[str] = ()) -> None:
    """Write rows of tiles below their titles, and beside their names, as a PNG as wide as a page.

    More than `_COLUMNS` columns are split into blocks of about equal size, one below the other.
    """
    count = ceil(len(titles) / _COLUMNS)
    breadth = ceil(len(titles) / count)
    tallest = max(np.shape(tile.image)[0] / np.shape(tile.image)[1] for tile in (row[0] for row in rows))
    height = tallest * ((style.PAGE - _NAMES * bool(names)) / breadth - _PADDING)
    height = _TITLE + len(rows) * (height + (_LABEL if any(t.label for row in rows for t in row) else _PADDING))
    with style.page(path, style.PAGE, count * height + (count - 1) * _GAP) as figure:
        for block, part in enumerate(figure.subfigures(count, squeeze=False, hspace=_GAP / height)[:, 0]):
            grid = part.subplots(len(rows), breadth, squeeze=False)
            chosen = slice(block * breadth, (block + 1) * breadth)
            for axes in grid.flat:
                axes.set_axis_off()
            for axes, title in zip(grid[0], titles[chosen], strict=False):
                axes.set_title(fill(title, _TITLE_WIDTH), pad=3)
            for row, tiles in zip(grid, rows, strict=True):
                for axes, tile in zip(row, tiles[chosen], strict=False):
                    axes.set_axis_on()
                    axes.imshow(as_bytes(tile.image))
                    axes.set_xticks([])
                    axes.set_yticks([])
                    axes.spines[:].set_visible(False)
                    axes.set_xlabel(tile.label, labelpad=2)
                    place = {"transform": axes.transAxes, "ha": "center", "va": "center"}
                    axes.text(0.5, 0.5, tile.text, fontsize=4.5, color=style.INK, **place)
            for row, name in zip(grid, names, strict=False):
                row[0].set_ylabel(name, labelpad=2)


def as_bytes(image: Image) -> UInt8:
    """Return an image as uint8."""
    return np.rint(255 * np.clip(image, 0, 1)).astype(np.uint8)


def draw_before_after(path: Path, folders: Mapping[str, Path], rows: int = 3) -> str:
    """Draw some views of folders of ``VIEW.png`` by title as a PNG, and return the caption.

    The first folder is the reference of the PSNR. A last column shows the difference between the last and the first.
    """
    views = common_views(folders.values())
    chosen = [views[i] for i in np.unique(np.linspace(0, len(views) - 1, rows).round().astype(int))]
    tiles = []
    for view in chosen:
        reference, *others = (read_image(folder / f"{view}.png") for folder in folders.values())
        labelled = [Tile(image, f"{decimal(psnr(reference, image))} dB") for image in others]
        tiles.append([Tile(reference, view), *labelled, Tile(_GAIN * np.abs(others[-1] - reference))])
    titles = [*map(display_name, folders)]
    write_tiles(path, [*titles, f"|difference| × {_GAIN}"], tiles)
    return (
        f"{len(chosen)} of {len(views)} views, with their PSNR against {titles[0]}. Last column: {_GAIN} times the "
        f"absolute difference between {titles[-1]} and {titles[0]}."
    )


def common_views(folders: Iterable[Path]) -> list[str]:
    """Return the sorted names of the views in all folders, or raise `InputError` if there is none."""
    folders = list(folders)
    views = sorted(set.intersection(*({path.stem for path in folder.glob("*.png")} for folder in folders)))
    if not views:
        raise InputError(folders[-1], "*.png", expected=f"a view of {folders[0]}", found="none")
    return views
