"""Grids of images: before and after GSPure, after every attack (Fig. 3 of the paper), and with each axis up."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import ceil, isfinite
from pathlib import Path
from textwrap import fill
from typing import Final, NamedTuple

import numpy as np

from gspure.arrays import Float32
from gspure.cameras.orbit import UP_SHEET, Up, orbit_cameras, up_of
from gspure.errors import InputError
from gspure.evaluation.outcomes import Outcome, ordered, title_with_damage
from gspure.figures import style
from gspure.images import levels, read_image
from gspure.metrics.image_metrics import METRICS, psnr
from gspure.metrics.names import GSPURE, UNATTACKED, display_name
from gspure.metrics.targets import MESSAGE, SCENE
from gspure.model import Gaussians
from gspure.progress import warn
from gspure.public_model import RenderView
from gspure.text import decimal

_COLUMNS: Final = 6  # most columns of a block, so that their titles are legible on a page
_GAIN: Final = 5  # factor of the displayed differences
_TITLE: Final = 0.26  # height of titles, inches: two lines
_TITLE_WIDTH: Final = 16  # letters in a line of them
_LABEL: Final = 0.15  # height of a tile's label
_NAMES: Final = 0.16  # width of the rows' names
_PADDING: Final = 0.04  # beside each tile
_GAP: Final = 0.15  # between blocks
_MAGNIFIED: Final = 2  # factor from which on pixels are shown as squares
_UNAFFECTED: Final = "†"  # marks messages that an attack did not affect
_AXES: Final = np.array([(0, -1, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (0, 0, -1), (-1, 0, 0)])


class Tile(NamedTuple):
    """An image [H,W,3] with a label below."""

    image: Float32
    label: str = ""


def write_tiles(path: Path, titles: Sequence[str], rows: Sequence[Sequence[Tile]], names: Sequence[str] = ()) -> None:
    """Write rows of tiles below their titles, and beside their names, as a PNG as wide as a page.

    More than `_COLUMNS` columns are split into blocks of about equal size, one below the other.
    """
    blocks = ceil(len(titles) / _COLUMNS)
    columns = ceil(len(titles) / blocks)
    inset = _NAMES if names else 0.0
    width = (style.PAGE - inset) / columns - _PADDING
    height = width * max(np.shape(row[0].image)[0] / np.shape(row[0].image)[1] for row in rows)
    has_labels = any(tile.label for row in rows for tile in row)
    step = height + (_LABEL if has_labels else _PADDING)
    block_height = _TITLE + len(rows) * step + _GAP
    total = blocks * block_height - _GAP
    pictures: list[style.Picture] = []
    with style.page(path, style.PAGE, total, layout=None, pictures=pictures) as figure:
        for column, title in enumerate(titles):
            x = (inset + (column % columns + 0.5) * (width + _PADDING)) / style.PAGE
            top = column // columns * block_height + _TITLE
            figure.text(x, 1 - (top - _PADDING) / total, fill(title, _TITLE_WIDTH), ha="center")
            for i, row in enumerate(rows):
                bottom = top + i * step + height
                centre = (x * style.PAGE * style.DPI, (bottom - height / 2) * style.DPI)
                pictures.append(_fitted(row[column].image, width * style.DPI, height * style.DPI, *centre))
                figure.text(x, 1 - (bottom + _PADDING / 2) / total, row[column].label, ha="center", va="top")
        for block in range(blocks):
            for i, name in enumerate(names):
                y = block * block_height + _TITLE + i * step + height / 2
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
    """Draw three views as a PNG, with a column for each folder of ``VIEW.png``, and return the caption.

    `folders` are by title; the first is the reference of the PSNR. The last column shows the difference between the
    last folder and the first.
    """
    views = _common_views(folders.values())
    shown = [views[i] for i in np.unique(np.linspace(0, len(views) - 1, 3).round().astype(int))]
    tiles = []
    for view in shown:
        reference, *images = (read_image(folder / f"{view}.png") for folder in folders.values())
        labelled = [Tile(image, f"{decimal(psnr(reference, image))} dB") for image in images]
        tiles.append([Tile(reference, view), *labelled, Tile(_GAIN * np.abs(images[-1] - reference))])
    titles = [*map(display_name, folders)]
    write_tiles(path, [*titles, f"|difference| × {_GAIN}"], tiles)
    return (
        f"{len(shown)} of {len(views)} views, with their PSNR against {titles[0]}. Last column: {_GAIN} times the "
        f"absolute difference between {titles[-1]} and {titles[0]}."
    )


def _common_views(folders: Iterable[Path]) -> list[str]:
    """Return the sorted names of the views in all folders, or raise `InputError` if there is none."""
    folders = list(folders)
    views = sorted(set.intersection(*({path.stem for path in folder.glob("*.png")} for folder in folders)))
    if not views:
        raise InputError(folders[-1], "*.png", expected=f"a view of {folders[0]}", found="none")
    return views


def shown_variants(outcomes: Sequence[Outcome], sweeps: Mapping[str, Sequence[str]]) -> list[Outcome]:
    """Return one variant of each attack that has results, in the order of `outcomes`.

    Of an attack at several strengths (`sweeps`), it is the variant with the largest drop of the message, or the first
    if no drop is known; of GSPure's variants, the method itself.
    """
    by_name = {outcome.variant: outcome for outcome in outcomes}
    left_out = set()
    for names in sweeps.values():
        variants = [by_name[name] for name in names if name in by_name]
        drops = {o.variant: o.psnr_drop(MESSAGE) for o in variants}
        known = {name: drop if isfinite(drop) else -np.inf for name, drop in drops.items()}
        variants.sort(key=lambda o: (o.variant == GSPURE, known[o.variant]), reverse=True)
        left_out |= {o.variant for o in variants[1:]}
    return [o for o in outcomes if o.targets and o.variant not in left_out and not o.is_control]


def draw_attacks(
    path: Path,
    folder: Path,
    outcomes: Sequence[Outcome],
    sweeps: Mapping[str, Sequence[str]],
    photographs: Path | None = None,
) -> tuple[str, dict[str, str]] | None:
    """Draw one view of scene and message after every attack, and return the caption and the view of each target.

    None if the unattacked model has no renders. `outcomes` are those of one model, whose renders lie in
    ``folder/VARIANT/renders/TARGET``. The references are the `photographs` or, without these, the renders of the
    unattacked model.
    """
    unattacked = next((o for o in outcomes if o.variant == UNATTACKED), None)
    if not unattacked or not unattacked.targets:
        return None
    attacks = [o for o in outcomes if not o.is_control]
    folders = {o.variant: folder / o.variant / "renders" for o in attacks}
    reference = photographs or folders[UNATTACKED]
    targets = ordered({target for o in attacks for target in o.targets})
    compared = MESSAGE if MESSAGE in targets else SCENE
    changed = UNATTACKED if photographs else _first_attack([o.variant for o in attacks if compared in o.targets])
    view, count = _typical_view(reference, folders[changed], compared)
    views = dict.fromkeys(targets, view)
    if SCENE in targets and not (reference / SCENE / f"{view}.png").is_file():  # the message has views of its own
        views[SCENE], _ = _typical_view(reference, folders[UNATTACKED], SCENE)

    shown = shown_variants(outcomes, sweeps)
    columns = shown if photographs else [o for o in shown if o.variant != UNATTACKED]
    rows = []
    for target, name in views.items():
        truth = read_image(_target_folder(reference, target) / f"{name}.png")
        attacked = [_tile(o, target, folders[o.variant] / target / f"{name}.png", truth) for o in columns]
        rows.append([Tile(truth), *attacked])
    titles = [
        "truth" if photographs else UNATTACKED,
        *(title_with_damage(o.title, o.wanted, o.damage) for o in columns),
    ]
    write_tiles(path, [*map(display_name, titles)], rows, [*map(display_name, targets)])

    titles_by_variant = {o.variant: o.title for o in outcomes}
    when = "before attacks" if changed == UNATTACKED else f"after {titles_by_variant[changed]}"
    caption = f"View {view} of {count} after every attack: the one with the median {compared} PSNR {when}."
    if any(_UNAFFECTED in tile.label for row in rows for tile in row):
        caption += f" {_UNAFFECTED} The attack changed nothing that this extraction reads."
    if len(shown) < sum(bool(o.targets) for o in attacks):
        caption += (
            " Attacks with several strengths are shown at the one that harms the message most, GSPure at its default."
        )
    return caption, views


def _first_attack(variants: Sequence[str]) -> str:
    """Return GSPure if it is among the variants, else the first attack, or `UNATTACKED` if there is none."""
    if GSPURE in variants:
        return GSPURE
    return next((variant for variant in variants if variant != UNATTACKED), UNATTACKED)


def _typical_view(reference: Path, renders: Path, target: str) -> tuple[str, int]:
    """Return the view of a target with the median PSNR, the lower one of two, and the number of views."""
    truth = _target_folder(reference, target)
    rendered = renders / target
    views = _common_views((truth, rendered))
    psnrs = {v: psnr(read_image(truth / f"{v}.png"), read_image(rendered / f"{v}.png")) for v in views}
    by_psnr = sorted(views, key=lambda view: (psnrs[view], view))
    return by_psnr[(len(views) - 1) // 2], len(views)


def _target_folder(folder: Path, target: str) -> Path:
    """Return the folder of a target's images; all extractions share the photographs of the message."""
    shared = folder / target.partition("_")[0]
    if not (folder / target).is_dir() and shared.is_dir():
        return shared
    return folder / target


def _tile(o: Outcome, target: str, file: Path, reference: Float32) -> Tile:
    """Return a target's view in `file`, after an attack, labelled with its PSNR."""
    if target not in o.targets:
        return Tile(np.full_like(reference, 0.94), "unreadable")
    image = read_image(file)
    label = f"{METRICS['psnr'].text(psnr(reference, image))} dB"
    if o.variant != UNATTACKED and o.reaches(target) is False:
        label += f" {_UNAFFECTED}"
    return Tile(image, label)


def draw_up_sheet(path: Path, model: Gaussians, render: RenderView, guess: Up) -> None:
    """Draw a model with each axis up; the axis nearest to the guessed up direction is marked."""
    likeness = _AXES @ guess.direction
    nearest = "the guess" if likeness.max() == 1 else "nearest to the guess"
    tiles = []
    for axis, is_nearest in zip(_AXES.tolist(), likeness == likeness.max(), strict=True):
        (view,) = orbit_cameras(model, count=1, up=axis, width=200, height=150)
        mark = f"   {nearest}" if is_nearest else ""
        tiles.append(Tile(render(view), f"--up {' '.join(map(str, axis))}{mark}"))
    write_tiles(path, ["", "", ""], [tiles[:3], tiles[3:]])


def mention_up(model: Gaussians, render: RenderView, up: Sequence[float] | None, folder: Path) -> None:
    """Warn if the up direction of generated views is an unsure guess, and draw the model with each axis up."""
    sheet = folder / UP_SHEET
    sheet.unlink(missing_ok=True)  # of an earlier run
    if up:
        return
    guess = up_of(model)
    if guess.is_sure:
        return
    draw_up_sheet(sheet, model, render, guess)
    warn(f"up is unsure: see {sheet}; pass --up X Y Z")
