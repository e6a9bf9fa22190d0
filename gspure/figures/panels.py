"""Grids of images: before and after GSPure, after every attack (Fig. 3 of the paper), and with each axis up."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import ceil, isfinite
from pathlib import Path
from textwrap import fill
from typing import Final, NamedTuple

import numpy as np

from gspure.arrays import Float32
from gspure.cameras.orbit import Up, orbit_cameras
from gspure.errors import InputError
from gspure.evaluation.matched import Sweeps, reached_damage, reached_name
from gspure.evaluation.outcomes import Outcome, ordered
from gspure.figures import style
from gspure.images import levels, read_image
from gspure.metrics.image_metrics import METRICS, psnr
from gspure.metrics.names import GSPURE, UNATTACKED, display_name
from gspure.metrics.targets import MESSAGE, SCENE
from gspure.model import Gaussians
from gspure.public_model import RenderView
from gspure.text import decimal

_COLUMNS: Final = 6  # at most in a block, so that their titles are legible on a page
_GAIN: Final = 5  # factor of the displayed differences
_TITLE: Final = 0.26  # height of titles, inches: two lines
_TITLE_WIDTH: Final = 16  # letters in a line of them
_LABEL: Final = 0.15  # height of a tile's label
_NAMES: Final = 0.16  # breadth of the rows' names
_PADDING: Final = 0.04  # beside each tile
_GAP: Final = 0.15  # between blocks
_MAGNIFIED: Final = 2  # factor from which on pixels are shown as squares
_AXES: Final = np.array([(0, -1, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, -1), (-1, 0, 0)])


class Tile(NamedTuple):
    """An image [H,W,3] with a label below."""

    image: Float32
    label: str = ""


def write_tiles(path: Path, titles: Sequence[str], rows: Sequence[Sequence[Tile]], names: Sequence[str] = ()) -> None:
    """Write rows of tiles below their titles, and beside their names, as a PNG as wide as a page.

    More than `_COLUMNS` columns are split into blocks of about equal size, one below the other.
    """
    count = ceil(len(titles) / _COLUMNS)
    breadth = ceil(len(titles) / count)
    inset = _NAMES * bool(names)
    width = (style.PAGE - inset) / breadth - _PADDING
    height = width * max(np.shape(row[0].image)[0] / np.shape(row[0].image)[1] for row in rows)
    step = height + (_LABEL if any(tile.label for row in rows for tile in row) else _PADDING)
    block = _TITLE + len(rows) * step + _GAP
    total = count * block - _GAP
    pictures: list[style.Picture] = []
    with style.page(path, style.PAGE, total, layout=None, pictures=pictures) as figure:
        for column, title in enumerate(titles):
            x = (inset + (column % breadth + 0.5) * (width + _PADDING)) / style.PAGE
            top = column // breadth * block + _TITLE
            figure.text(x, 1 - (top - _PADDING) / total, fill(title, _TITLE_WIDTH), ha="center")
            for i, row in enumerate(rows):
                bottom = top + i * step + height
                centre = (x * style.PAGE * style.DPI, (bottom - height / 2) * style.DPI)
                pictures.append(_fitted(row[column].image, width * style.DPI, height * style.DPI, *centre))
                figure.text(x, 1 - (bottom + _PADDING / 2) / total, row[column].label, ha="center", va="top")
        for at in range(count * len(rows) * bool(names)):
            y = at // len(rows) * block + _TITLE + at % len(rows) * step + height / 2
            name = names[at % len(rows)]
            figure.text(inset / 2 / style.PAGE, 1 - y / total, name, ha="center", va="center", rotation=90)


def _fitted(image: Float32, width: float, height: float, x: float, y: float) -> style.Picture:
    """Return an image that fills as much as it can of a box of pixels around a centre (x, y)."""
    from PIL import Image

    rows, columns = image.shape[:2]
    scale = min(width / columns, height / rows)
    size = round(scale * columns), round(scale * rows)
    filtering = Image.Resampling.NEAREST if scale >= _MAGNIFIED else Image.Resampling.LANCZOS
    pixels = np.asarray(Image.fromarray(levels(image)).resize(size, filtering))
    return round(x - size[0] / 2), round(y - size[1] / 2), pixels


def draw_before_after(path: Path, folders: Mapping[str, Path]) -> str:
    """Draw three views of folders of ``VIEW.png`` by title as a PNG, and return the caption.

    The first folder is the reference of the PSNR. A last column shows the difference between the last and the first.
    """
    views = _common_views(folders.values())
    chosen = [views[i] for i in np.unique(np.linspace(0, len(views) - 1, 3).round().astype(int))]
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


def _common_views(folders: Iterable[Path]) -> list[str]:
    """Return the sorted names of the views in all folders, or raise `InputError` if there is none."""
    folders = list(folders)
    views = sorted(set.intersection(*({path.stem for path in folder.glob("*.png")} for folder in folders)))
    if not views:
        raise InputError(folders[-1], "*.png", expected=f"a view of {folders[0]}", found="none")
    return views


def chosen(outcomes: Sequence[Outcome], sweeps: Sweeps) -> list[Outcome]:
    """Return one variant of each attack, in the order of `outcomes`.

    Of the variants of one attack at several strengths (`sweeps`), it is the one with the highest Score, or the first
    if no Score is known; of GSPure's variants, the method itself.
    """
    by_name = {outcome.variant: outcome for outcome in outcomes}
    passed = set()
    for names in sweeps.values():
        known = [by_name[name] for name in names if name in by_name]
        known.sort(key=lambda o: (o.variant == GSPURE, o.score if isfinite(o.score) else -np.inf), reverse=True)
        passed |= {o.variant for o in known[1:]}
    return [o for o in outcomes if o.variant not in passed and not o.is_control]


def draw_attacks(
    path: Path, folder: Path, outcomes: Sequence[Outcome], sweeps: Sweeps, photographs: Path | None = None
) -> tuple[str, dict[str, str]] | None:
    """Draw one view of scene and message after every attack, and return the caption and the view of each target.

    None if the unattacked model has no renders. `outcomes` are those of one model, whose renders lie in
    ``folder/VARIANT/renders/TARGET``. The reference are the `photographs` or, without these, the renders of the
    unattacked model.
    """
    targets = ordered({target for o in outcomes for target in o.targets if not o.is_control})
    unattacked = next((o for o in outcomes if o.variant == UNATTACKED), None)
    if not unattacked or not unattacked.targets:
        return None
    folders = {o.variant: folder / o.variant / "renders" for o in outcomes if not o.is_control}
    reference = photographs or folders[UNATTACKED]
    compared = MESSAGE if MESSAGE in targets else SCENE
    rendered = [o.variant for o in outcomes if compared in o.targets and o.variant in folders]
    attacked = sorted({*rendered} - {UNATTACKED}, key=lambda name: (name != GSPURE, rendered.index(name)))
    changed = attacked[0] if attacked and not photographs else UNATTACKED
    view, count = _typical(reference, folders[changed], compared)
    views = dict.fromkeys(targets, view)
    if SCENE in targets and not (reference / SCENE / f"{view}.png").is_file():  # the message has views of its own
        views[SCENE], _ = _typical(reference, folders[UNATTACKED], SCENE)
    references = {t: read_image(_target_folder(reference, t) / f"{name}.png") for t, name in views.items()}
    shown = chosen(outcomes, sweeps)
    columns = shown if photographs else [o for o in shown if o.variant != UNATTACKED]
    titles = ["truth" if photographs else UNATTACKED, *(reached_name(o.variant, reached_damage(o)) for o in columns)]
    rows = [
        [Tile(image), *(_tile(o, target, folders[o.variant] / target / f"{views[target]}.png", image) for o in columns)]
        for target, image in references.items()
    ]
    write_tiles(path, [*map(display_name, titles)], rows, [*map(display_name, targets)])
    of = f"after {display_name(changed)}" if changed != UNATTACKED else "before attacks"
    caption = f"View {view} of {count} after every attack: the one with the median {compared} PSNR {of}."
    if any("†" in tile.label for row in rows for tile in row):
        caption += " † The attack changed nothing that this extraction reads."
    if len(shown) < len(folders):
        caption += " Attacks with several strengths are shown at the one with the highest Score, GSPure at its default."
    return caption, views


def _typical(reference: Path, renders: Path, target: str) -> tuple[str, int]:
    """Return the view of a target with the median PSNR, the lower one of two, and of how many."""
    truth, shown = _target_folder(reference, target), renders / target
    views = _common_views((truth, shown))
    level = {view: psnr(*(read_image(folder / f"{view}.png") for folder in (truth, shown))) for view in views}
    return sorted(views, key=lambda view: (level[view], view))[(len(views) - 1) // 2], len(views)


def _target_folder(folder: Path, target: str) -> Path:
    """Return the folder of a target's images; the truth of all extractions is that of the message."""
    return next((p for p in (folder / target, folder / target.partition("_")[0]) if p.is_dir()), folder / target)


def _tile(o: Outcome, target: str, file: Path, reference: Float32) -> Tile:
    """Return the view of a target after an attack with its PSNR."""
    if target not in o.targets:
        return Tile(np.full_like(reference, 0.94), "failed")
    image = read_image(file)
    missed = " †" * (o.variant != UNATTACKED and o.reaches(target) is False)
    return Tile(image, f"{METRICS['psnr'].text(psnr(reference, image))} dB{missed}")


def draw_up_sheet(path: Path, model: Gaussians, render: RenderView, guess: Up) -> None:
    """Draw a model with each axis up; the axis nearest to the guessed up direction is marked."""
    likeness = _AXES @ guess.direction
    is_axis = likeness.max() == 1
    tiles = []
    for axis, is_nearest in zip(_AXES.tolist(), likeness == likeness.max(), strict=True):
        (view,) = orbit_cameras(model, count=1, up=axis, width=200, height=150)
        mark = f"   {'the' if is_axis else 'nearest to the'} guess" if is_nearest else ""
        tiles.append(Tile(render(view), f"--up {' '.join(map(str, axis))}{mark}"))
    write_tiles(path, [""] * 3, [tiles[:3], tiles[3:]])
