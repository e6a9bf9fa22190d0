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
from gspure.report.table import Cell, Column, Row, Table, few, interval, markdown_document
from gspure.report.tables import scenes_of, text_of
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
    rows = (survivals, contests, matched)
    conditions = dict.fromkeys([*(row.condition for row in survivals), *(row.condition for row in matched)])
    tables = {known.title: [*chain(*condition_tables(known, *rows).values())] for known in conditions}
    return markdown_document(tables) if tables else "No model with a message was attacked.\n"


def condition_tables(
    condition: Condition, survivals: Sequence[Survival], contests: Sequence[Contest], matched: Sequence[Matched] = ()
) -> dict[str, list[Table]]:
    """Return the tables of one condition over all of its scenes, by extraction of the message."""
    names = {row.variant: row.name for row in survivals if row.condition == condition}
    titles = {row.variant: row.title for row in survivals}
    kinds: list[tuple[Callable[..., Table], Sequence[Survival | Contest | Matched]]] = [
        (survival_table, survivals),
        (partial(other_attacks_table, names=names), [row for row in contests if isnan(row.damage)]),
        (partial(equal_damage_table, titles=titles), [row for row in contests if not isnan(row.damage)]),
        (partial(matched_table, titles=titles), matched),
    ]
    alike = [(kind, [row for row in rows if row.condition == condition]) for kind, rows in kinds]
    extractions = ordered({row.extraction for _, rows in alike for row in rows})
    return {
        extraction: [
            kind(chosen) for kind, rows in alike if (chosen := [r for r in rows if r.extraction == extraction])
        ]
        for extraction in extractions
    }


def survival_table(attacks: Sequence[Survival]) -> Table:
    """Return the survival of one extraction of the message after each attack."""
    is_shown = is_picture(attacks[0].extraction)
    has_controls = any(row.above_floor or row.present for row in attacks)
    scenes = max(row.scenes for row in attacks)
    columns = [Column("attack"), Column(*_dropped(attacks[0].extraction)), Column("scene", "PSNR drop")]
    columns += [Column("RMS ratio", main=False)] * is_shown
    if has_controls:
        above = "message above" if is_shown else "mark above"
        columns += [Column("survived"), Column("share left")]
        columns += [Column(name, above, main=False) for name in ("controls", "wrong key")]
        columns += [Column("detectability", main=False)] * (scenes > 1)
    rows, text = [], text_of(attacks[0].extraction)
    for row in attacks:
        name = row.name + (" †" if row.reached is False and row.variant != UNATTACKED else "")
        cells = [Cell(name, few(row.scenes, scenes)), interval(row.message_drop, row.scenes, text)]
        cells += [interval(row.scene_drop, row.scenes), *[Cell(decimal(row.rms_ratio))] * is_shown]
        if has_controls:
            retrieved = f"(+{row.only_retrieved})" if row.only_retrieved else ""
            cells.append(Cell(f"{row.survived} of {row.present}", retrieved) if row.present else Cell())
            cells.append(Cell(percent(row.share_left.mean if row.share_left else nan)))
            cells += [interval(above, row.scenes, text) for above in (row.above_floor, row.above_wrong_key)]
            if scenes > 1:
                auc = row.detectability
                spread = f"[{decimal(auc.low)}, {decimal(auc.high)}], {display_name(row.control)}" if auc else ""
                cells.append(Cell(decimal(auc.auc if auc else nan), spread))
        rows.append(Row(cells))
    return Table(f"Survival of the {extraction_name(attacks[0].extraction)}", columns, rows, _SURVIVAL)


def other_attacks_table(contests: Sequence[Contest], names: Mapping[str, str]) -> Table:
    """Return GSPure minus every other attack as both were run; some have other `names` than their display names."""
    scenes, extraction = scenes_of(row.difference for row in contests), contests[0].extraction
    has_score = is_picture(extraction)
    columns = [Column("attack"), *[Column("Score")] * has_score, Column(*_dropped(extraction))]
    columns += [Column("scene", "PSNR drop"), *[Column("p")] * (has_score and scenes > 1)]
    rows = []
    for attack, alike in grouped(contests, lambda row: row.attack).items():
        quantities = {row.quantity: row for row in alike}
        shown = [quantities[name] for name in (SCORE, MESSAGE_DROP, SCENE_DROP) if name in quantities]
        compared = scenes_of(row.difference for row in shown)
        texts = [decimal if row.quantity == SCENE_DROP else text_of(extraction) for row in shown]
        cells = [interval(row.difference, compared, text) for row, text in zip(shown, texts, strict=True)]
        if has_score and scenes > 1:
            p = [significant(value, 2) for value in (shown[0].p_adjusted, shown[0].p_attainable)]
            cells.append(Cell(p[0], f"(≥ {p[1]})"))
        rows.append(Row([Cell(names.get(attack, display_name(attack)), few(compared, scenes)), *cells]))
    title = f"GSPure minus other attacks: {extraction_name(extraction)}"
    return Table(title, columns, rows, _OTHERS)


def equal_damage_table(contests: Sequence[Contest], titles: Mapping[str, str]) -> Table:
    """Return GSPure minus every other attack at equal damage to the scene; `titles` are those of variants."""
    damages, scenes = dict.fromkeys(row.damage for row in contests), scenes_of(row.difference for row in contests)
    rows, extraction = [], contests[0].extraction
    for attack, alike in grouped(contests, lambda row: row.attack).items():
        at, text = {row.damage: row.difference for row in alike}, text_of(extraction)
        rows.append(
            Row(
                [
                    Cell(titles.get(attack) or display_name(attack)),
                    *(interval(at.get(damage), scenes, text) for damage in damages),
                ]
            )
        )
    title = f"GSPure minus other attacks at equal damage to the scene: {extraction_name(extraction)}"
    return Table(title, [Column("attack"), *_permitted(damages)], rows, _EQUAL)


def matched_table(matched: Sequence[Matched], titles: Mapping[str, str]) -> Table:
    """Return the drop of one extraction in each sweep at equal damage to the scene, the largest in bold."""
    most: dict[float, float] = {}
    scenes = scenes_of(row.drop for row in matched)
    for row in matched:
        if row.scene_drop <= row.damage and row.drop.scenes == scenes:
            most[row.damage] = max(row.drop.mean, most.get(row.damage, -inf))
    damages, rows = sorted({row.damage for row in matched}), []
    for sweep, group in grouped(matched, lambda row: row.sweep).items():
        at = {row.damage: row for row in group}
        drops = [_drop_at(at[damage], most.get(damage), scenes) if damage in at else Cell() for damage in damages]
        strengths = Cell(f"{next(iter(at.values())).strengths}")
        rows.append(Row([Cell(titles.get(sweep) or display_name(sweep)), strengths, *drops]))
    title = f"Drop of the {extraction_name(matched[0].extraction)} at equal damage to the scene"
    return Table(title, [Column("attack"), Column("strengths", main=False), *_permitted(damages)], rows, _MATCHED)


def _dropped(extraction: str) -> tuple[str, str]:
    """Return title and group of the column of an extraction's drop."""
    return ("message", "PSNR drop") if is_picture(extraction) else (extraction_name(extraction), "drop")


def _permitted(damages: Iterable[float]) -> list[Column]:
    return [Column(f"{damage:g} dB", "scene drop of") for damage in damages]


def _drop_at(row: Matched, most: float | None, scenes: int) -> Cell:
    """Return a drop, with the drop of the scene where it is not the permitted one."""
    cell = interval(row.drop, scenes, text_of(row.extraction))
    cell = cell._replace(best=row.scene_drop <= row.damage and row.drop.mean == most)
    if row.scene_drop == row.damage:
        return cell
    bound = "≥ " if row.scene_drop < row.damage else "≤ "
    return cell._replace(text=f"{bound}{cell.text}", detail=f"{cell.detail} at {decimal(row.scene_drop)} dB".lstrip())
