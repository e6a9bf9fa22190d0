"""What is left of the message after each attack, and GSPure against each, as Markdown for reading."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

from gspure.evaluation.contest import MESSAGE_DROP, SCENE_DROP, SCORE, Contest
from gspure.evaluation.outcomes import MESSAGE, REFERENCE
from gspure.evaluation.statistics import MATCHED_DAMAGES, Detectability, Interval
from gspure.evaluation.survival import MARGIN, Survival

LEFT: Final = f"""\
In dB, mean over scenes. Brackets: 95 % interval over scenes; parentheses: range of fewer than six. Above controls: how
far the message's PSNR lies above all that is seen of the same scene where there is none: in a model without message, in
another scene's model, in pictures of one colour. Where that is {MARGIN:g} dB or more the message is there. Survives in:
of the scenes in which it is there before any attack. Above a wrong key: what it shows of the unattacked model. Told
from controls: the probability that an attacked model shows more of the message than a model without it, of the kind
that it is told from least, with its 95 % interval; 0.5 is chance. † The attack did not touch what this extraction
reads."""

AGAINST: Final = """\
GSPure less the other, in dB, mean over scenes: positive where GSPure has more, so that it does better in Score and
message, and worse in the scene. p: sign-flip test of the Score over scenes, two-sided, after Holm's correction for all
of the table; in parentheses the least that it can be with as many scenes."""

EQUAL: Final = """\
What the message loses to GSPure less what it loses to the other, in dB, where either may cost the scene what the column
says: mean over scenes."""


def contest_markdown(survivals: Sequence[Survival], contests: Sequence[Contest]) -> str:
    """Return up to three tables per scheme and extraction of the message, and what their columns mean."""
    if not survivals:
        return "No model with a message was attacked.\n"
    lines: list[str] = []
    for scheme, extraction in dict.fromkeys((row.scheme, row.extraction) for row in survivals):
        of_both = (scheme, extraction)
        lines += [f"### {scheme}" + ("" if extraction == MESSAGE else f" / {extraction}"), ""]
        lines += _left([row for row in survivals if row[:2] == of_both])
        for rows in (_against(contests, of_both), _at_equal_damage(contests, of_both)):
            lines += [*rows, ""] if rows else []
    return "\n".join([*lines, LEFT, "", AGAINST, "", EQUAL, ""])


def _left(rows: Iterable[Survival]) -> list[str]:
    columns = ["message drop", "scene drop", "survives in", "above controls", "above a wrong key"]
    lines = _head(["attack", *columns, "told from controls"])
    for row in rows:
        missed = " †" if row.reached is False and row.variant != REFERENCE else ""
        scenes = f"{row.survived} of {row.present}" if row.present else ""
        drops = (_shown(row.message_drop), _shown(row.scene_drop))
        above = (_shown(row.above_controls), _shown(row.above_wrong_key))
        lines.append(_line([row.variant + missed, *drops, scenes, *above, _told(row.told, row.control)]))
    return [*lines, ""]


def _against(contests: Sequence[Contest], of_both: tuple[str, str]) -> list[str]:
    found = {(c.rival, c.quantity): c for c in contests if c[:2] == of_both and math.isnan(c.damage)}
    lines = _head(["GSPure less", "Score", "message drop", "scene drop", "p"])
    for rival in dict.fromkeys(rival for rival, _ in found):
        differences = [str(found[rival, quantity].difference) for quantity in (SCORE, MESSAGE_DROP, SCENE_DROP)]
        score = found[rival, SCORE]
        lines.append(_line([rival, *differences, f"{score.adjusted:.2g} ({score.attainable:.2g})"]))
    return lines if found else []


def _at_equal_damage(contests: Sequence[Contest], of_both: tuple[str, str]) -> list[str]:
    found = {(c.rival, c.damage): str(c.difference) for c in contests if c[:2] == of_both and not math.isnan(c.damage)}
    lines = _head(["GSPure less", *(f"{damage:g} dB" for damage in MATCHED_DAMAGES)])
    for rival in dict.fromkeys(rival for rival, _ in found):
        lines.append(_line([rival, *(found[rival, damage] for damage in MATCHED_DAMAGES)]))
    return lines if found else []


def _head(columns: Sequence[str]) -> list[str]:
    return [_line(columns), "| --- |" + " ---: |" * (len(columns) - 1)]


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _shown(interval: Interval | None) -> str:
    return str(interval) if interval else ""


def _told(told: Detectability | None, control: str) -> str:
    return f"{told.auc:.2f} [{told.low:.2f}, {told.high:.2f}], {control}" if told else ""
