"""The pictures that tell which direction of a model is up."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from gspure.cameras.orbit import UP_SHEET, orbit_cameras, up_of
from gspure.figures.panels import Tile, write_tiles
from gspure.model import Gaussians
from gspure.progress import warn
from gspure.public_model import RenderView

_AXES: Final = np.array([(0, -1, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, -1), (-1, 0, 0)])


def mention_up(model: Gaussians, render: RenderView, up: Sequence[float] | None, folder: Path) -> None:
    """Warn if the up direction of generated views is an unsure guess, and draw a model with each axis up, labelled."""
    (sheet := folder / UP_SHEET).unlink(missing_ok=True)  # of an earlier run
    if up or (guess := up_of(model)).is_sure:
        return
    likeness, tiles = _AXES @ guess.direction, []
    for axis, is_nearest in zip(_AXES.tolist(), likeness == likeness.max(), strict=True):
        (view,) = orbit_cameras(model, count=1, up=axis, width=200, height=150)
        mark = f"   {'the' if likeness.max() == 1 else 'nearest to the'} guess" if is_nearest else ""
        tiles.append(Tile(render(view), f"--up {' '.join(map(str, axis))}{mark}"))
    write_tiles(sheet, [""] * 3, [tiles[:3], tiles[3:]])
    warn(f"up is unsure: see {sheet}; pass --up X Y Z")
