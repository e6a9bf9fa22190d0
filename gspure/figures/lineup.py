"""Scene and message after every attack, side by side, as in the paper's qualitative comparison (Fig. 3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from textwrap import fill
from typing import Final, NamedTuple

import numpy as np

from gspure.evaluation.matched import reached_damage, reached_name
from gspure.evaluation.metrics import METRICS, psnr
from gspure.evaluation.names import GSPURE, UNATTACKED, display_name
from gspure.evaluation.outcomes import MESSAGE, SCENE, Outcome, ordered
from gspure.figures.panels import Image, Tile, common_views, write_tiles
from gspure.images import read_image

_WORDS: Final = 30  # letters in a line of a reason
_LINES: Final = 6  # and its lines


class Attacks(NamedTuple):
    """The figure of all attacks: its caption, and the view that it shows of every target."""

    caption: str
    views: dict[str, str]


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


def _tile(o: Outcome, target: str, file: Path, reference: Image) -> Tile:
    """Return the view of a target after an attack with its PSNR, or the reason why there is none."""
    if target not in o.targets:
        reason = fill(o.failure, _WORDS, max_lines=_LINES, placeholder=" …")
        return Tile(np.full_like(reference, 0.94), "failed", reason)
    image = read_image(file)
    missed = " †" * (o.variant != UNATTACKED and o.reaches(target) is False)
    return Tile(image, f"{METRICS['psnr'].text(psnr(reference, image))} dB{missed}")
