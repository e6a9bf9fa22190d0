"""Scene and message after every attack, side by side, as in the paper's qualitative comparison (Fig. 3)."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from gspure.evaluation.matched import reached_damage, reached_name
from gspure.evaluation.metrics import METRICS, psnr
from gspure.evaluation.names import GSPURE, UNATTACKED, display_name
from gspure.evaluation.outcomes import MESSAGE, SCENE, Outcome, ordered
from gspure.figures import style
from gspure.figures.panels import Image, common_views, show
from gspure.images import read_image

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS: Final = 6  # most columns in a block, so that their titles are legible on a page

_TITLE: Final = 0.26  # height of a block's titles, inches: two lines
_TITLE_WIDTH: Final = 16  # letters in a line of them
_LABEL: Final = 0.15  # height of a tile's label
_NAMES: Final = 0.16  # breadth of the rows' names
_PADDING: Final = 0.04  # beside each tile
_GAP: Final = 0.15  # between blocks
_WORDS: Final = 30  # letters in a line of a reason
_LINES: Final = 6  # and its lines


@dataclass(frozen=True)
class Column:
    """The images [H,W,3] of one variant, or of the reference, by target; none if it failed.

    `unaffected` are the targets that read nothing that the attack changed; `failure` says why there are no images.
    """

    name: str
    images: Mapping[str, Image]
    unaffected: frozenset[str] = frozenset()
    failure: str = ""


def chosen(outcomes: Sequence[Outcome], sweeps: Mapping[str, Sequence[str]]) -> list[Outcome]:
    """Return one variant of each attack, in the order of `outcomes`.

    Of the variants of one attack at several strengths (`sweeps`), it is the one with the highest Score, or the first
    if no Score is known; of GSPure's variants, the method itself.
    """
    by_name = {outcome.variant: outcome for outcome in outcomes}
    passed = set()
    for names in sweeps.values():
        known = [by_name[name] for name in names if name in by_name]
        if known:
            passed |= {outcome.variant for outcome in known} - {max(known, key=_merit).variant}
    return [outcome for outcome in outcomes if outcome.variant not in passed and not outcome.is_control]


def _merit(outcome: Outcome) -> tuple[bool, float]:
    return outcome.variant == GSPURE, outcome.score if isfinite(outcome.score) else -np.inf


class Attacks(NamedTuple):
    """The figure of all attacks: its caption, and the view that it shows of every target."""

    caption: str
    views: dict[str, str]


def draw_attacks(
    path: Path,
    folder: Path,
    outcomes: Sequence[Outcome],
    sweeps: Mapping[str, Sequence[str]],
    photographs: Path | None = None,
) -> Attacks | None:
    """Draw one view of scene and message after every attack; None if the unattacked model has no renders.

    `outcomes` are those of one model, whose renders lie in ``folder/VARIANT/renders/TARGET``. The reference are the
    `photographs` or, without these, the renders of the unattacked model.
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
    first = {target: read_image(_target_folder(reference, target) / f"{name}.png") for target, name in views.items()}
    columns = [Column("truth" if photographs else UNATTACKED, first)]
    shown = chosen(outcomes, sweeps)
    for o in shown if photographs else [o for o in shown if o.variant != UNATTACKED]:
        images = {target: read_image(folders[o.variant] / target / f"{views[target]}.png") for target in o.targets}
        unaffected = frozenset(target for target, reached in o.reached.items() if not reached)
        name = reached_name(o.variant, reached_damage(o))
        columns.append(Column(name, images, unaffected if o.variant != UNATTACKED else frozenset(), o.failure))
    write_lineup(path, targets, columns)
    of = f"after {display_name(changed)}" if changed != UNATTACKED else "before attacks"
    caption = f"View {view} of {count} after every attack: the one with the median {compared} PSNR {of}."
    if any(column.unaffected for column in columns):
        caption += " † The attack changed nothing that this extraction reads."
    if len(shown) < len(folders):
        caption += " Attacks with several strengths are shown at the one with the highest Score, GSPure at its default."
    return Attacks(caption, views)


def _typical(reference: Path, renders: Path, target: str) -> tuple[str, int]:
    """Return the view of a target with the median PSNR, the lower one of two, and of how many."""
    truth, shown = _target_folder(reference, target), renders / target
    views = common_views((truth, shown))
    level = {view: psnr(*(read_image(folder / f"{view}.png") for folder in (truth, shown))) for view in views}
    return sorted(views, key=lambda view: (level[view], view))[(len(views) - 1) // 2], len(views)


def _target_folder(folder: Path, target: str) -> Path:
    """Return the folder of a target's images; the truth of all extractions is that of the message."""
    return next((p for p in (folder / target, folder / target.partition("_")[0]) if p.is_dir()), folder / target)


def write_lineup(path: Path, targets: Sequence[str], columns: Sequence[Column]) -> None:
    """Write a column of images for every variant and a row for every target as a PNG, as wide as a page.

    The first column is the reference: it has an image of every target; the PSNR of the others is measured against it.
    More than `COLUMNS` columns are split into blocks of about equal size, one below the other.
    """
    count = ceil(len(columns) / COLUMNS)
    breadth = ceil(len(columns) / count)
    blocks = [columns[first : first + breadth] for first in range(0, len(columns), breadth)]
    tallest = max(np.shape(image)[0] / np.shape(image)[1] for image in columns[0].images.values())
    tile = tallest * ((style.PAGE - _NAMES) / breadth - _PADDING)
    height = _TITLE + len(targets) * (tile + _LABEL)
    with style.page(path, style.PAGE, count * height + (count - 1) * _GAP) as figure:
        parts = figure.subfigures(count, squeeze=False, hspace=_GAP / height)
        for part, block in zip(parts[:, 0], blocks, strict=True):
            grid = part.subplots(len(targets), breadth, squeeze=False)
            for column, axes in zip(block, grid[0], strict=False):
                axes.set_title(textwrap.fill(display_name(column.name), _TITLE_WIDTH), pad=3)
            for target, row in zip(targets, grid, strict=True):
                for column, axes in zip(block, row, strict=False):
                    _draw(axes, column, target, columns[0].images[target])
                row[0].set_ylabel(display_name(target), labelpad=2)
                for axes in row[len(block) :]:
                    axes.set_axis_off()


def _draw(axes: Axes, column: Column, target: str, reference: Image) -> None:
    image = column.images.get(target)
    if image is None:
        show(axes, np.full_like(reference, 0.94), "failed")
        reason = "\n".join(textwrap.wrap(column.failure, _WORDS, max_lines=_LINES, placeholder=" …"))
        axes.text(0.5, 0.5, reason, transform=axes.transAxes, ha="center", va="center", fontsize=4.5, color=style.INK)
    elif image is reference:
        show(axes, image, "")
    else:
        unaffected = " †" if target in column.unaffected else ""
        show(axes, image, f"{METRICS['psnr'].text(psnr(reference, image))} dB{unaffected}")
