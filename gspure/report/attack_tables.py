"""The tables of one condition: survival after every attack, and GSPure against the others."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import chain
from math import inf, isnan, nan
from typing import Final

from gspure.evaluation.contest import MESSAGE_DROP, SCENE_DROP, SCORE, Contest
from gspure.evaluation.identity import Condition
from gspure.evaluation.matched import Matched
from gspure.evaluation.outcomes import ordered
from gspure.evaluation.survival import Survival
from gspure.grouping import grouped
from gspure.metrics.image_metrics import MARGIN
from gspure.metrics.names import UNATTACKED, display_name, extraction_name
from gspure.metrics.targets import is_picture
from gspure.report.table import Cell, Column, Table, TableRow, interval, markdown_document, scene_count
from gspure.report.tables import number_format, scenes_of
from gspure.text import decimal, percent, significant

_SPREAD: Final = (
    "Means over scenes; in parentheses the smallest and largest value of a scene, in brackets, from six scenes on, the "
    "95% interval."
)
_UNITS: Final = "PSNR in dB; marks in percentage points of correct bits, or in units of the score."
_SURVIVAL: Final = (
    f"{_UNITS} {_SPREAD} RMS ratio: root-mean-square damage to the message divided by that to the scene. Control "
    "level: the highest PSNR, or mean reading, among a scene's controls that do not hold its message. Survived: of the "
    "scenes in which the message is present before the attack, those in which it still is; (+n): n more in which it is "
    f"only retrieved. A picture is present if it is {MARGIN:g} dB above the control level and, if retrieval ran in "
    "enough views, retrieved; a mark, if more views than chance explains exceed the threshold of 1% false positives, "
    "but not in the clean model. Share left: level above the controls after the attack, divided by that before. "
    "Detectability: AUC against the control model that is hardest to distinguish. †: the attack changed nothing that "
    "this extraction reads."
)
_OTHERS: Final = (
    f"{_UNITS} {_SPREAD} Positive: GSPure has the higher Score, removes more of the message, or harms the scene more. "
    "p: sign-flip test of the Score over scenes, Holm-corrected; in parentheses, the smallest value possible."
)
_EQUAL: Final = (
    f"{_UNITS} {_SPREAD} Both attacks lower the scene's PSNR by the amount in the heading. Positive: GSPure removes "
    "more."
)
_MATCHED: Final = (
    f"{_UNITS} {_SPREAD} Drop where the attack lowers the scene's PSNR by the amount in the heading, interpolated "
    "between tested strengths. ≥: in some scene no strength does as much damage. ≤: every strength does more. Bold: "
    "the largest."
)


def conditions_markdown(survivals: Sequence[Survival], contests: Sequence[Contest], matched: Sequence[Matched]) -> str:
    """Return the tables of every condition over all of its scenes."""
    conditions = dict.fromkeys([*(row.condition for row in survivals), *(row.condition for row in matched)])
    sections = {}
    for condition in conditions:
        by_extraction = condition_tables(condition, survivals, contests, matched)
        sections[condition.title] = [*chain(*by_extraction.values())]
    return markdown_document(sections) if sections else "No model with a message was attacked.\n"


def condition_tables(
    condition: Condition, survivals: Sequence[Survival], contests: Sequence[Contest], matched: Sequence[Matched] = ()
) -> dict[str, list[Table]]:
    """Return the tables of one condition over all of its scenes, by extraction of the message."""
    titles = {row.variant: row.title for row in survivals}
    names = titles | {row.variant: row.name for row in survivals if row.condition == condition}
    kinds: list[tuple[Callable[..., Table], Sequence[Survival | Contest | Matched]]] = [
        (survival_table, survivals),
        (partial(other_attacks_table, names=names), [row for row in contests if isnan(row.damage)]),
        (partial(equal_damage_table, titles=titles), [row for row in contests if not isnan(row.damage)]),
        (partial(matched_table, titles=titles), matched),
    ]
    alike = [(table, [row for row in rows if row.condition == condition]) for table, rows in kinds]
    tables = {}
    for extraction in ordered({row.extraction for _, rows in alike for row in rows}):
        by_extraction = [(table, [row for row in rows if row.extraction == extraction]) for table, rows in alike]
        tables[extraction] = [table(rows) for table, rows in by_extraction if rows]
    return tables


def survival_table(attacks: Sequence[Survival]) -> Table:
    """Return the survival of one extraction of the message after each attack."""
    extraction = attacks[0].extraction
    is_shown = is_picture(extraction)
    has_controls = any(row.above_floor or row.present for row in attacks)
    scenes = max(row.scenes for row in attacks)
    columns = [Column("attack"), Column(*_dropped(extraction)), Column("scene", "PSNR drop")]
    if is_shown:
        columns.append(Column("RMS ratio", main=False))
    if has_controls:
        above = "message above" if is_shown else "mark above"
        columns += [Column("survived"), Column("share left")]
        columns += [Column("controls", above, main=False), Column("wrong key", above, main=False)]
    if has_controls and scenes > 1:
        columns.append(Column("detectability", main=False))
    rows = []
    for row in attacks:
        is_unaffected = row.reached is False and row.variant != UNATTACKED
        name = f"{row.name} †" if is_unaffected else row.name
        cells = [Cell(name, scene_count(row.scenes, scenes))]
        cells.append(interval(row.message_drop, row.scenes, number_format(extraction)))
        cells.append(interval(row.scene_drop, row.scenes))
        if is_shown:
            cells.append(Cell(decimal(row.rms_ratio)))
        if has_controls:
            cells += _beside_controls(row)
        if has_controls and scenes > 1:
            cells.append(_detectability(row))
        rows.append(TableRow(cells))
    return Table(f"Survival of the {extraction_name(extraction)}", columns, rows, _SURVIVAL)


def _beside_controls(row: Survival) -> list[Cell]:
    """Return the scenes in which the message survived, its share left, and its margins above controls and wrong key."""
    retrieved = f"(+{row.only_retrieved})" if row.only_retrieved else ""
    text = number_format(row.extraction)
    return [
        Cell(f"{row.survived} of {row.present}", retrieved) if row.present else Cell(),
        Cell(percent(row.share_left.mean if row.share_left else nan)),
        interval(row.above_floor, row.scenes, text),
        interval(row.above_wrong_key, row.scenes, text),
    ]


def _detectability(row: Survival) -> Cell:
    """Return the AUC with its interval, and the control model that is hardest to distinguish."""
    auc = row.detectability
    if auc is None:
        return Cell()
    return Cell(decimal(auc.auc), f"[{decimal(auc.low)}, {decimal(auc.high)}], {display_name(row.control)}")


def other_attacks_table(contests: Sequence[Contest], names: Mapping[str, str]) -> Table:
    """Return GSPure minus every other attack as both were run; some have other `names` than their display names."""
    extraction = contests[0].extraction
    scenes = scenes_of(row.difference for row in contests)
    has_score = is_picture(extraction)
    has_test = has_score and scenes > 1
    columns = [Column("attack")]
    if has_score:
        columns.append(Column("Score"))
    columns += [Column(*_dropped(extraction)), Column("scene", "PSNR drop")]
    if has_test:
        columns.append(Column("p"))
    rows = []
    for attack, alike in grouped(contests, lambda row: row.attack).items():
        by_quantity = {row.quantity: row for row in alike}
        shown = [by_quantity[name] for name in (SCORE, MESSAGE_DROP, SCENE_DROP) if name in by_quantity]
        compared = scenes_of(row.difference for row in shown)
        cells = [Cell(names.get(attack, display_name(attack)), scene_count(compared, scenes))]
        for row in shown:
            text = decimal if row.quantity == SCENE_DROP else number_format(extraction)
            cells.append(interval(row.difference, compared, text))
        if has_test:
            p = significant(shown[0].p_adjusted, 2)
            smallest_p = significant(shown[0].p_attainable, 2)
            cells.append(Cell(p, f"(≥ {smallest_p})"))
        rows.append(TableRow(cells))
    title = f"GSPure minus other attacks: {extraction_name(extraction)}"
    return Table(title, columns, rows, _OTHERS)


def equal_damage_table(contests: Sequence[Contest], titles: Mapping[str, str]) -> Table:
    """Return GSPure minus every other attack at equal damage to the scene; `titles` are those of variants."""
    extraction = contests[0].extraction
    text = number_format(extraction)
    damages = dict.fromkeys(row.damage for row in contests)
    scenes = scenes_of(row.difference for row in contests)
    rows = []
    for attack, alike in grouped(contests, lambda row: row.attack).items():
        by_damage = {row.damage: row.difference for row in alike}
        differences = [interval(by_damage.get(damage), scenes, text) for damage in damages]
        rows.append(TableRow([Cell(titles.get(attack) or display_name(attack)), *differences]))
    title = f"GSPure minus other attacks at equal damage to the scene: {extraction_name(extraction)}"
    return Table(title, [Column("attack"), *_permitted(damages)], rows, _EQUAL)


def matched_table(matched: Sequence[Matched], titles: Mapping[str, str]) -> Table:
    """Return the drop of one extraction in each sweep at equal damage to the scene, the largest in bold."""
    scenes = scenes_of(row.drop for row in matched)
    damages = sorted({row.damage for row in matched})
    most: dict[float, float] = {}
    for row in matched:
        if row.scene_drop <= row.damage and row.drop.scenes == scenes:
            most[row.damage] = max(row.drop.mean, most.get(row.damage, -inf))
    rows = []
    for sweep, alike in grouped(matched, lambda row: row.sweep).items():
        by_damage = {row.damage: row for row in alike}
        drops = [
            _drop_at(by_damage[damage], most.get(damage), scenes) if damage in by_damage else Cell()
            for damage in damages
        ]
        rows.append(TableRow([Cell(titles.get(sweep) or display_name(sweep)), Cell(f"{alike[0].strengths}"), *drops]))
    title = f"Drop of the {extraction_name(matched[0].extraction)} at equal damage to the scene"
    return Table(title, [Column("attack"), Column("strengths", main=False), *_permitted(damages)], rows, _MATCHED)


def _dropped(extraction: str) -> tuple[str, str]:
    """Return title and group of the column of an extraction's drop."""
    return ("message", "PSNR drop") if is_picture(extraction) else (extraction_name(extraction), "drop")


def _permitted(damages: Iterable[float]) -> list[Column]:
    return [Column(f"{damage:g} dB", "scene drop of") for damage in damages]


def _drop_at(row: Matched, most: float | None, scenes: int) -> Cell:
    """Return a drop, with the drop of the scene if it is not the permitted one."""
    cell = interval(row.drop, scenes, number_format(row.extraction))
    cell = cell._replace(best=row.scene_drop <= row.damage and row.drop.mean == most)
    if row.scene_drop == row.damage:
        return cell
    bound = "≥ " if row.scene_drop < row.damage else "≤ "
    return cell._replace(text=f"{bound}{cell.text}", detail=f"{cell.detail} at {decimal(row.scene_drop)} dB".lstrip())
