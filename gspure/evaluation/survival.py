"""What is left of the message after each attack: whether it stands out from what is seen where there is none."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from numpy.typing import ArrayLike

from gspure.evaluation.controls import CLEAN, FLOORS, OTHER_SCENE, WRONG_KEY
from gspure.evaluation.outcomes import REFERENCE, SCENE, Outcome, ordered
from gspure.evaluation.sheet import Cell, read_sheet, write_sheet
from gspure.evaluation.statistics import (
    Cells,
    Detectability,
    Interval,
    by_scene,
    detectability,
    differences,
    known_interval,
    mean_interval,
)

MARGIN: Final = 1.0
"""How far a message stands out from its scene's controls that is told to survive, dB. Ours: about what an eye sees."""

MODELS: Final = (CLEAN, OTHER_SCENE)
"""Models without the message. A wrong key is no such control: what it shows is a model that holds the message."""

CONTROLS: Final = (*MODELS, *FLOORS)
"""All that is seen where there is no message. An extraction may show black of a clean model, which a message in shreds
surpasses easily; so a message has to tell more than one flat colour would, too."""

HEADER: Final = (
    *("scheme", "extraction", "variant", "present", "survived", "reached"),
    *(f"message_drop_{part}" for part in Interval._fields),
    *(f"scene_drop_{part}" for part in Interval._fields),
    *(f"above_controls_{part}" for part in Interval._fields),
    *(f"above_wrong_key_{part}" for part in Interval._fields),
    *("control", *Detectability._fields),
)


class Survival(NamedTuple):
    """One attack on one scheme, or none, over all scenes; what no scene knows is None."""

    scheme: str
    extraction: str
    """The target that shows the message."""

    variant: str
    present: int
    """In how many scenes the message of the unattacked model stands out by `MARGIN` from the scene's controls."""

    survived: int
    """In how many of these it still does."""

    reached: bool | None
    """Whether the attack touched what the extraction reads, in any scene."""

    message_drop: Interval | None
    scene_drop: Interval | None
    above_controls: Interval | None
    """How far the message's PSNR lies above the highest of the same scene's `CONTROLS`, dB."""

    above_wrong_key: Interval | None
    """How far above what a wrong key shows of the unattacked model, dB."""

    control: str
    """The kind of model without message that it is told from least; "" if there is none."""

    told: Detectability | None
    """How well it is told from that kind, one value per scene."""

    @property
    def survives(self) -> bool | None:
        """Whether the message survives wherever it was; None if it does in some scenes, or was in none."""
        return self.survived > 0 if self.survived in {0, self.present} and self.present else None


def survival(outcomes: Sequence[Outcome]) -> list[Survival]:
    """Tell what is left of the message, for every scheme, extraction and variant that is no control.

    Seeds are averaged within scenes. Controls are compared kind by kind, since those of one scene share its truth and
    are not independent of each other.

    Parameters
    ----------
    outcomes : sequence of Outcome
        In any order; schemes and variants stay in it.

    """
    found = []
    for scheme in dict.fromkeys(o.scheme for o in outcomes):
        ours = [o for o in outcomes if o.scheme == scheme]
        for extraction in ordered({target for o in ours for target in o.messages}):
            left = _left(ours, extraction)
            for variant in dict.fromkeys(o.variant for o in ours if not o.is_control and extraction in o.targets):
                attacked = [o for o in ours if o.variant == variant]
                found.append(_survival(attacked, extraction, left))
    return found


def write_survival(path: Path, rows: Iterable[Survival]) -> None:
    """Write one CSV row per variant; unknown numbers are empty."""
    write_sheet(path, HEADER, map(_cells, rows))


def read_survival(path: Path) -> list[Survival]:
    """Read what `write_survival` has written, or raise `InputError`."""
    return read_sheet(path, HEADER, "a table of what is left of messages", _row)


def _left(outcomes: Sequence[Outcome], extraction: str) -> dict[str, dict[tuple[str, int], float]]:
    """Return the PSNR of the message by variant and control, and by scene and seed."""
    found: dict[str, dict[tuple[str, int], float]] = {}
    for o in outcomes:
        if extraction in o.targets and math.isfinite(psnr := o.targets[extraction].psnr):
            found.setdefault(o.variant, {})[o.scene, o.seed] = psnr
    return found


def _survival(attacked: Sequence[Outcome], extraction: str, left: Mapping[str, Cells]) -> Survival:
    first = attacked[0]
    ours, controls = left.get(first.variant, {}), _highest(left, CONTROLS)
    before = _standing_out(left.get(REFERENCE, {}), controls)
    after = _standing_out(ours, controls)
    known = [o.reached[extraction] for o in attacked if extraction in o.reached]
    told = {
        kind: detectability(_scene_means(ours), _scene_means(left[kind])) for kind in MODELS if ours and kind in left
    }
    control = min(told, key=lambda kind: told[kind].auc, default="")
    return Survival(
        first.scheme,
        extraction,
        first.variant,
        len(before & {scene for scene, _ in ours}),
        len(before & after),
        any(known) if known else None,
        known_interval(_drops(attacked, extraction)),
        known_interval(_drops(attacked, SCENE)),
        _mean(differences(ours, controls)),
        _mean(differences(ours, left.get(WRONG_KEY, {}))),
        control,
        told.get(control),
    )


def _drops(attacked: Sequence[Outcome], target: str) -> Cells:
    return {(o.scene, o.seed): o.psnr_drop(target) for o in attacked}


def _highest(left: Mapping[str, Cells], kinds: Iterable[str]) -> dict[tuple[str, int], float]:
    """Return the highest of some kinds of controls in every scene and seed."""
    found: dict[tuple[str, int], float] = {}
    for kind in kinds:
        for cell, psnr in left.get(kind, {}).items():
            found[cell] = max(psnr, found.get(cell, psnr))
    return found


def _standing_out(ours: Cells, controls: Cells) -> set[str]:
    """Return the scenes in which the mean over seeds lies `MARGIN` or more above the highest control."""
    scenes = sorted({scene for scene, _ in ours.keys() & controls.keys()})
    margins = differences(ours, controls)
    return {scene for scene, margin in zip(scenes, margins, strict=True) if margin.mean() >= MARGIN}


def _scene_means(cells: Cells) -> list[float]:
    return [float(seeds.mean()) for seeds in by_scene(cells)]


def _mean(scenes: Sequence[ArrayLike]) -> Interval | None:
    return mean_interval(scenes) if scenes else None


def _cells(row: Survival) -> Iterator[Cell]:
    unknown = (None,) * len(Interval._fields)
    yield from (*row[:5], "" if row.reached is None else str(row.reached).lower())
    for interval in (row.message_drop, row.scene_drop, row.above_controls, row.above_wrong_key):
        yield from interval or unknown
    yield row.control
    yield from row.told or (None,) * len(Detectability._fields)


def _row(
    scheme: str, extraction: str, variant: str, present: str, survived: str, reached: str, *cells: str
) -> Survival:
    touched = {"true": True, "false": False, "": None}.get(reached)
    width = len(Interval._fields)
    message, scene, controls, wrong_key = (_interval(*cells[i : i + width]) for i in range(0, 4 * width, width))
    control, *told = cells[4 * width :]
    told_from = _detectability(*told) if control else None
    of_variant = (scheme, extraction, variant, int(present), int(survived), touched)
    return Survival(*of_variant, message, scene, controls, wrong_key, control, told_from)


def _interval(mean: str, low: str, high: str, level: str, scenes: str) -> Interval | None:
    return Interval(float(mean), float(low), float(high), float(level), int(scenes)) if mean else None


def _detectability(auc: str, low: str, high: str, assets: str, controls: str) -> Detectability:
    return Detectability(float(auc), float(low), float(high), int(assets), int(controls))
