"""The tables of the report, built from those of the evaluation."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from math import inf, isfinite, isnan, nan
from types import MappingProxyType
from typing import Final

from gspure.evaluation.contest import MESSAGE_DROP, SCENE_DROP, SCORE, Contest
from gspure.evaluation.costs import AttackCost
from gspure.evaluation.csv_tables import grouped
from gspure.evaluation.intervals import Interval
from gspure.evaluation.matched import Matched, reached_names
from gspure.evaluation.metrics import METRICS
from gspure.evaluation.names import UNATTACKED, condition_name, display_name, extraction_name, model_name
from gspure.evaluation.outcomes import MESSAGE, SCENE, Condition, Outcome, by_model, condition_of, is_picture, ordered
from gspure.evaluation.paper import Beside
from gspure.evaluation.summary import summarize
from gspure.evaluation.survival import MARGIN, Survival
from gspure.progress import UNKNOWN, decimal, percent, signed, significant
from gspure.report.table import Cell, Column, Row, Table, change, few, interval, markdown_document, metric, share
from gspure.report.templates import say

NOTES: Final = "notes.j2"
SHARES: Final = ("pruned_share", "precision", "recall")
NO_NAMES: Final[Mapping[str, str]] = MappingProxyType({})
NO_COSTS: Final[Mapping[str, AttackCost]] = MappingProxyType({})
_COST: Final = [Column("CPU time [s]"), Column("peak memory [MiB]", main=False)]


def results_markdown(outcomes: Sequence[Outcome]) -> str:
    """Return one table per model, and the reason of every failure."""
    document = markdown_document({model_name(*key): [model_table(group)] for key, group in by_model(outcomes)})
    return "\n".join([document, *(f"{sentence}\n" for sentence in failures(outcomes))])


def conditions_markdown(
    survivals: Sequence[Survival] = (),
    contests: Sequence[Contest] = (),
    matched: Sequence[Matched] = (),
    costs: Sequence[AttackCost] = (),
) -> str:
    """Return the tables of every condition over all of its scenes."""
    rows = (survivals, contests, matched, costs)
    conditions = dict.fromkeys([*(condition_of(row) for row in survivals), *(condition_of(row) for row in matched)])
    tables = {condition_name(*known): condition_tables(known, *rows) for known in conditions}
    return markdown_document(tables) if tables else "No model with a message was attacked.\n"


def condition_tables(
    condition: Condition,
    survivals: Sequence[Survival],
    contests: Sequence[Contest],
    matched: Sequence[Matched] = (),
    costs: Sequence[AttackCost] = (),
) -> list[Table]:
    """Return the tables of one condition over all of its scenes, by extraction of the message."""
    known = [row for row in costs if condition_of(row) == condition]
    cost, of_sweeps = ({row.attack: row for row in known if row.kind == kind} for kind in ("variant", "sweep"))
    names = {row.variant: row.name for row in survivals if condition_of(row) == condition}
    kinds: list[tuple[Callable[..., Table], Sequence[Survival | Contest | Matched]]] = [
        (partial(survival_table, cost=cost), survivals),
        (partial(other_attacks_table, names=names), [row for row in contests if isnan(row.damage)]),
        (equal_damage_table, [row for row in contests if not isnan(row.damage)]),
        (partial(matched_table, cost=cost | of_sweeps), matched),
    ]
    alike = [(kind, [row for row in rows if condition_of(row) == condition]) for kind, rows in kinds]
    extractions = ordered({row.extraction for _, rows in alike for row in rows})
    return [
        kind(chosen)
        for extraction in extractions
        for kind, rows in alike
        if (chosen := [row for row in rows if row.extraction == extraction])
    ]


def model_table(outcomes: Sequence[Outcome]) -> Table:
    """Return every variant of one model with its metrics."""
    measured = [o for o in outcomes if not o.failure]
    targets = ordered({target for o in measured for target in o.targets})
    off_path = [target for target in targets if any(target in o.off_path for o in measured)]
    extractions = [*filter(is_picture, targets)]
    detectors = {name: read.bits for o in measured for name, read in o.detections.items()}
    shares = [name for name in SHARES if any(isfinite(getattr(o, name)) for o in measured)]
    has_strengths, names = any(o.strength for o in measured), reached_names(measured)
    best = max((o.score for o in measured if isfinite(o.score)), default=nan)
    columns = [
        Column("variant"),
        *[Column("strength", main=False)] * has_strengths,
        *(
            Column(m.title, display_name(target), main=target in (SCENE, MESSAGE) and name == "psnr")
            for target in targets
            for name, m in METRICS.items()
        ),
        *(Column(display_name(target), "Score", main=target == MESSAGE) for target in extractions),
        *(
            Column(title, display_name(name), main=title != "TPR 0.1%")
            for name, bits in detectors.items()
            for title in ("correct bits" if bits else "score", "TPR 1%", "TPR 0.1%")
        ),
        *(Column(name.removesuffix("_share"), main=name == "pruned_share") for name in shares),
        *(Column(display_name(target), "PSNR off path", main=False) for target in off_path),
    ]
    rows = []
    for o in measured:
        scores = [change(o.score_of(target)) for target in extractions]
        if is_best := o.score == best:
            scores[0] = scores[0]._replace(best=True)
        cells = [
            Cell(names[o.variant]),
            *[Cell(o.strength or UNKNOWN)] * has_strengths,
            *(cell for target in targets for cell in _metrics(o, target)),
            *scores,
            *(cell for name in detectors for cell in _detection(o, name)),
            *(share(getattr(o, name)) for name in shares),
            *(metric(o.off_path[target].psnr) if target in o.off_path else Cell() for target in off_path),
        ]
        rows.append(Row(cells, "control" if o.is_control else "best" if is_best else ""))
    missed = any("†" in cell.text for row in rows for cell in row.cells)
    note = say(NOTES, "model", measured, off_path, extractions, shares, missed, sorted({*detectors.values()}))
    return Table("Metrics of every variant", columns, rows, note)


def survival_table(attacks: Sequence[Survival], cost: Mapping[str, AttackCost] = NO_COSTS) -> Table:
    """Return the survival of one extraction of the message after each attack, with the cost of each."""
    is_shown = is_picture(attacks[0].extraction)
    has_floor = any(row.above_floor or row.present for row in attacks)
    scenes = max(row.scenes for row in attacks)
    columns = [Column("attack"), Column(*_dropped(attacks[0].extraction)), Column("scene", "PSNR drop")]
    columns += [*_COST * bool(cost), *[Column("RMS ratio", main=False)] * is_shown]
    if has_floor:
        above = "message above" if is_shown else "mark above"
        columns += [
            Column("survived"),
            Column("share left"),
            *(Column(name, above, main=False) for name in ("the floor", "wrong key")),
        ]
        columns += [Column("detectability", main=False)] * (scenes > 1)
    rows, text = [], _text(attacks[0].extraction)
    for row in attacks:
        name = row.name + (" †" if row.reached is False and row.variant != UNATTACKED else "")
        cells = [Cell(name, few(row.scenes, scenes)), interval(row.message_drop, row.scenes, text)]
        cells += [interval(row.scene_drop, row.scenes), *_cost(row.variant, cost)]
        cells += [Cell(decimal(row.rms_ratio))] * is_shown
        if has_floor:
            retrieved = f"(+{row.only_retrieved})" if row.only_retrieved else ""
            cells.append(Cell(f"{row.survived} of {row.present}", retrieved) if row.present else Cell())
            cells.append(share(row.share_left.mean if row.share_left else nan))
            cells += [interval(above, row.scenes, text) for above in (row.above_floor, row.above_wrong_key)]
            cells += [_detectability(row)] * (scenes > 1)
        rows.append(Row(cells))
    note = say(NOTES, "survival", scenes, has_floor, MARGIN, bool(cost), is_shown)
    return Table(f"Survival of the {extraction_name(attacks[0].extraction)}", columns, rows, note)


def other_attacks_table(contests: Sequence[Contest], names: Mapping[str, str] = NO_NAMES) -> Table:
    """Return GSPure minus every other attack as both were run; some have other `names` than their display names."""
    by_attack: dict[str, dict[str, Contest]] = {}
    for row in contests:
        by_attack.setdefault(row.attack, {})[row.quantity] = row
    scenes = _scenes(row.difference for row in contests)
    extraction = contests[0].extraction
    has_score = is_picture(extraction)
    columns = [Column("attack"), *[Column("Score")] * has_score, Column(*_dropped(extraction))]
    columns += [Column("scene", "PSNR drop"), *[Column("p")] * (has_score and scenes > 1)]
    rows = []
    for attack, quantities in by_attack.items():
        shown = [quantities[name] for name in (SCORE, MESSAGE_DROP, SCENE_DROP) if name in quantities]
        compared = _scenes(row.difference for row in shown)
        texts = [decimal if row.quantity == SCENE_DROP else _text(extraction) for row in shown]
        cells = [interval(row.difference, compared, text) for row, text in zip(shown, texts, strict=True)]
        if has_score and scenes > 1:
            p = [significant(value, 2) for value in (shown[0].p_adjusted, shown[0].p_attainable)]
            cells.append(Cell(p[0], f"(≥ {p[1]})"))
        rows.append(Row([Cell(names.get(attack, display_name(attack)), few(compared, scenes)), *cells]))
    title = f"GSPure minus other attacks: {extraction_name(extraction)}"
    return Table(title, columns, rows, say(NOTES, "other_attacks", scenes, has_score))


def equal_damage_table(contests: Sequence[Contest]) -> Table:
    """Return GSPure minus every other attack at equal damage to the scene."""
    by_attack = {row.attack: {c.damage: c for c in contests if c.attack == row.attack} for row in contests}
    damages, scenes = dict.fromkeys(row.damage for row in contests), _scenes(row.difference for row in contests)
    rows, extraction = [], contests[0].extraction
    for attack, by_damage in by_attack.items():
        known = [by_damage[damage].difference if damage in by_damage else None for damage in damages]
        rows.append(Row([Cell(display_name(attack)), *(interval(mean, scenes, _text(extraction)) for mean in known)]))
    title = f"GSPure minus other attacks at equal damage to the scene: {extraction_name(extraction)}"
    note = say(NOTES, "equal_damage", scenes, is_picture(extraction))
    return Table(title, [Column("attack"), *_permitted(damages)], rows, note)


def matched_table(matched: Sequence[Matched], cost: Mapping[str, AttackCost] = NO_COSTS) -> Table:
    """Return the drop of one extraction in each sweep at equal damage to the scene, the largest in bold."""
    most: dict[float, float] = {}
    scenes = _scenes(row.drop for row in matched)
    for row in matched:
        if row.scene_drop <= row.damage and row.drop.scenes == scenes:
            most[row.damage] = max(row.drop.mean, most.get(row.damage, -inf))
    damages, rows = sorted({row.damage for row in matched}), []
    for sweep, group in grouped(matched, lambda row: row.sweep).items():
        at = {row.damage: row for row in group}
        drops = [_drop_at(at[damage], most.get(damage), scenes) if damage in at else Cell() for damage in damages]
        strengths = Cell(f"{next(iter(at.values())).strengths}")
        rows.append(Row([Cell(display_name(sweep)), strengths, *_cost(sweep, cost), *drops]))
    gentle, harsh = (any(sign * (row.damage - row.scene_drop) > 0 for row in matched) for sign in (1, -1))
    extraction = matched[0].extraction
    title = f"Drop of the {extraction_name(extraction)} at equal damage to the scene"
    note = say(NOTES, "matched", scenes, gentle, harsh, bool(cost), is_picture(extraction))
    columns = [Column("attack"), Column("strengths", main=False), *_COST * bool(cost), *_permitted(damages)]
    return Table(title, columns, rows, note)


def summary_table(outcomes: Sequence[Outcome]) -> Table:
    """Return the means over scenes, with what the paper prints for its scenes."""
    titles = ("Scenes", "Scene", "Message", "Score", "Score [paper]")
    columns = [Column("Scheme"), Column("Attack", text=True), *map(Column, titles)]
    rows, body = summarize(outcomes), []
    for condition, alike in grouped(rows, condition_of).items():
        names = reached_names(o for o in outcomes if o.condition == condition)
        for i, row in enumerate(alike):
            extraction = "" if row.extraction == MESSAGE else f", {extraction_name(row.extraction)}"
            shown = [Cell("" if i else condition_name(*condition)), Cell(names[row.variant] + extraction)]
            scenes = _scenes((row.scene, row.message, row.score))
            means = [
                Cell(text(value.mean), few(value.scenes, scenes)) if value else Cell()
                for value, text in ((row.scene, decimal), (row.message, _text(row.extraction)))
            ]
            numbers = [*means, interval(row.score, scenes), Cell(decimal(row.paper_score))]
            body.append(Row([*shown, Cell(f"{scenes}"), *numbers], begins=not i))
    has_marks = not all(is_picture(row.extraction) for row in rows)
    return Table(
        "Means over scenes",
        columns,
        body,
        say(NOTES, "summary", has_marks, sorted({o.against_truth for o in outcomes if o.targets})),
    )


def beside_table(rows: Sequence[Beside]) -> Table:
    """Return the attacks of the paper's Table 1 beside ours."""
    quantities = ("scene drop", "message drop", "Score", "RMS ratio")
    pairs = [Column(source, name) for name in quantities for source in ("paper", "ours")]
    body = []
    for condition, group in grouped(rows, condition_of).items():
        for i, row in enumerate(group):
            names = [Cell("" if i else condition_name(*condition)), Cell(display_name(row.variant))]
            paper = (row.paper_scene_drop, row.paper_message_drop, row.paper_score, row.paper_rms_ratio)
            ours = (row.scene_drop, row.message_drop, row.score, row.rms_ratio)
            numbers = [Cell(decimal(value)) for pair in zip(paper, ours, strict=True) for value in pair]
            body.append(Row([*names, Cell(str(row.scenes or UNKNOWN)), *numbers], begins=not i))
    columns = [Column("condition"), Column("attack", text=True), Column("our scenes"), *pairs]
    return Table("The attacks of Table 1", columns, body, say(NOTES, "beside"))


def failures(outcomes: Sequence[Outcome]) -> list[str]:
    """Return a sentence for every reason of a failure, with the models and variants that failed for it."""
    failed: dict[str, list[str]] = {}
    for o in outcomes:
        for name, reason in o.failures.items():
            failed.setdefault(reason, []).append(f"{name} on {model_name(o.scheme, o.folder)}")
    return [say(NOTES, "failure", names, reason) for reason, names in failed.items()]


def _dropped(extraction: str) -> tuple[str, str]:
    """Return title and group of the column of an extraction's drop."""
    return ("message", "PSNR drop") if is_picture(extraction) else (extraction_name(extraction), "drop")


def _detection(o: Outcome, name: str) -> list[Cell]:
    """Return the mean reading of a detector with its standard deviation, and its rates."""
    if name not in o.detections:
        return [Cell()] * 3
    read = o.detections[name]
    level = percent(read.level / 100) if read.bits else significant(read.level)
    return [Cell(level, f"(± {significant(read.spread, 2)})"), share(read.tpr), share(read.tpr_strict)]


def _metrics(o: Outcome, target: str) -> Iterator[Cell]:
    """Yield the metrics of one target, PSNR with its change against the unattacked model."""
    for name in METRICS:
        if target not in o.targets:
            yield Cell()
            continue
        cell = metric(o.targets[target].values[name], name)
        drop = o.psnr_drop(target)
        if name == "psnr":
            missed = o.variant != UNATTACKED and o.reaches(target) is False
            changed = isfinite(drop) and drop != 0
            cell = Cell(cell.text + " †" * missed, f"({signed(-drop)})" if changed else "")
        yield cell


def _detectability(row: Survival) -> Cell:
    auc = row.detectability
    if auc is None:
        return Cell()
    return Cell(decimal(auc.auc), f"[{decimal(auc.low)}, {decimal(auc.high)}], {display_name(row.control)}")


def _cost(attack: str, cost: Mapping[str, AttackCost]) -> list[Cell]:
    """Return the cells of `_COST`; none if no cost is known."""
    if attack not in cost:
        return [Cell()] * len(_COST) * bool(cost)
    cpu = cost[attack].cpu
    return [Cell(decimal(cpu, 0 if cpu >= 10 else 1)), Cell(decimal(cost[attack].memory, 0))]


def _permitted(damages: Iterable[float]) -> list[Column]:
    return [Column(f"{damage:g} dB", "scene drop of") for damage in damages]


def _text(extraction: str) -> Callable[[float], str]:
    """Return how to write numbers of an extraction: dB with fixed decimals; scores of detectors have any magnitude."""
    return decimal if is_picture(extraction) else significant


def _drop_at(row: Matched, most: float | None, scenes: int) -> Cell:
    """Return a drop, with the drop of the scene where it is not the permitted one."""
    cell = interval(row.drop, scenes, _text(row.extraction))
    cell = cell._replace(best=row.scene_drop <= row.damage and row.drop.mean == most)
    if row.scene_drop == row.damage:
        return cell
    bound = "≥ " if row.scene_drop < row.damage else "≤ "
    return cell._replace(text=f"{bound}{cell.text}", detail=f"{cell.detail} at {decimal(row.scene_drop)} dB".lstrip())


def _scenes(intervals: Iterable[Interval | None]) -> int:
    """Return the number of scenes behind some means; 0 if none is known."""
    return max((value.scenes for value in intervals if value), default=0)
