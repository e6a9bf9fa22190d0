"""The tables of the report, built from those of the evaluation."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from math import inf, isfinite, isnan, nan
from types import MappingProxyType
from typing import Final

from gspure.evaluation.contest import MESSAGE_DROP, SCENE_DROP, SCORE, Contest
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

SHARES: Final = ("pruned_share", "precision", "recall")
_NO_NAMES: Final[Mapping[str, str]] = MappingProxyType({})
_SPREAD: Final = (
    "Means over scenes; in parentheses the smallest and largest value of a scene, in brackets, from six scenes on, the "
    "95% interval."
)
_UNITS: Final = "PSNR in dB; marks in percentage points of correct bits, or in units of the score."
_MODEL: Final = (
    "PSNR in dB, mean over views, against photographs or, without these, renders of the unattacked model (∞: "
    "identical); in parentheses, the change from the unattacked model. Score: drop of the message's PSNR minus that of "
    "the scene; the highest is in bold. Region PSNR: without the reference's most frequent colour. NC: normalized "
    "correlation. GC: gradient correlation. TPR: true positive rate over the views at this false positive rate. "
    "Precision: share of the pruned rows that carry the message. Recall: share of the message's rows that were pruned. "
    "†: the attack changed nothing that this extraction reads."
)
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
_SUMMARY: Final = (
    "PSNR in dB, mean over scenes; for marks, the column Message shows correct bits in percent, or the score. In "
    "brackets: 95% bootstrap interval over scenes; in parentheses, for fewer than six scenes: smallest and largest "
    "value. Last column: Score from the paper, for its scenes and attack strengths; not directly comparable."
)
_BESIDE: Final = (
    "In dB, except the RMS ratio. Paper: mean over the nine scenes of its Table 1, with the Score recomputed from its "
    "PSNR. Ours: mean over our scenes in which the message was present before the attack, at our strengths."
)


def results_markdown(outcomes: Sequence[Outcome]) -> str:
    """Return one table per model, and the reason of every failure."""
    document = markdown_document({model_name(*key): [model_table(group)] for key, group in by_model(outcomes)})
    return "\n".join([document, *(f"{sentence}\n" for sentence in failures(outcomes))])


def conditions_markdown(
    survivals: Sequence[Survival] = (),
    contests: Sequence[Contest] = (),
    matched: Sequence[Matched] = (),
) -> str:
    """Return the tables of every condition over all of its scenes."""
    rows = (survivals, contests, matched)
    conditions = dict.fromkeys([*(condition_of(row) for row in survivals), *(condition_of(row) for row in matched)])
    tables = {condition_name(*known): condition_tables(known, *rows) for known in conditions}
    return markdown_document(tables) if tables else "No model with a message was attacked.\n"


def condition_tables(
    condition: Condition,
    survivals: Sequence[Survival],
    contests: Sequence[Contest],
    matched: Sequence[Matched] = (),
) -> list[Table]:
    """Return the tables of one condition over all of its scenes, by extraction of the message."""
    names = {row.variant: row.name for row in survivals if condition_of(row) == condition}
    kinds: list[tuple[Callable[..., Table], Sequence[Survival | Contest | Matched]]] = [
        (survival_table, survivals),
        (partial(other_attacks_table, names=names), [row for row in contests if isnan(row.damage)]),
        (equal_damage_table, [row for row in contests if not isnan(row.damage)]),
        (matched_table, matched),
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
        ]
        rows.append(Row(cells, "control" if o.is_control else "best" if is_best else ""))
    return Table("Metrics of every variant", columns, rows, _MODEL)


def survival_table(attacks: Sequence[Survival]) -> Table:
    """Return the survival of one extraction of the message after each attack."""
    is_shown = is_picture(attacks[0].extraction)
    has_controls = any(row.above_floor or row.present for row in attacks)
    scenes = max(row.scenes for row in attacks)
    columns = [Column("attack"), Column(*_dropped(attacks[0].extraction)), Column("scene", "PSNR drop")]
    columns += [Column("RMS ratio", main=False)] * is_shown
    if has_controls:
        above = "message above" if is_shown else "mark above"
        columns += [
            Column("survived"),
            Column("share left"),
            *(Column(name, above, main=False) for name in ("controls", "wrong key")),
        ]
        columns += [Column("detectability", main=False)] * (scenes > 1)
    rows, text = [], _text(attacks[0].extraction)
    for row in attacks:
        name = row.name + (" †" if row.reached is False and row.variant != UNATTACKED else "")
        cells = [Cell(name, few(row.scenes, scenes)), interval(row.message_drop, row.scenes, text)]
        cells += [interval(row.scene_drop, row.scenes), *[Cell(decimal(row.rms_ratio))] * is_shown]
        if has_controls:
            retrieved = f"(+{row.only_retrieved})" if row.only_retrieved else ""
            cells.append(Cell(f"{row.survived} of {row.present}", retrieved) if row.present else Cell())
            cells.append(share(row.share_left.mean if row.share_left else nan))
            cells += [interval(above, row.scenes, text) for above in (row.above_floor, row.above_wrong_key)]
            cells += [_detectability(row)] * (scenes > 1)
        rows.append(Row(cells))
    return Table(f"Survival of the {extraction_name(attacks[0].extraction)}", columns, rows, _SURVIVAL)


def other_attacks_table(contests: Sequence[Contest], names: Mapping[str, str] = _NO_NAMES) -> Table:
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
    return Table(title, columns, rows, _OTHERS)


def equal_damage_table(contests: Sequence[Contest]) -> Table:
    """Return GSPure minus every other attack at equal damage to the scene."""
    by_attack = {row.attack: {c.damage: c for c in contests if c.attack == row.attack} for row in contests}
    damages, scenes = dict.fromkeys(row.damage for row in contests), _scenes(row.difference for row in contests)
    rows, extraction = [], contests[0].extraction
    for attack, by_damage in by_attack.items():
        known = [by_damage[damage].difference if damage in by_damage else None for damage in damages]
        rows.append(Row([Cell(display_name(attack)), *(interval(mean, scenes, _text(extraction)) for mean in known)]))
    title = f"GSPure minus other attacks at equal damage to the scene: {extraction_name(extraction)}"
    return Table(title, [Column("attack"), *_permitted(damages)], rows, _EQUAL)


def matched_table(matched: Sequence[Matched]) -> Table:
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
        rows.append(Row([Cell(display_name(sweep)), strengths, *drops]))
    title = f"Drop of the {extraction_name(matched[0].extraction)} at equal damage to the scene"
    return Table(title, [Column("attack"), Column("strengths", main=False), *_permitted(damages)], rows, _MATCHED)


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
    return Table("Means over scenes", columns, body, _SUMMARY)


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
    return Table("The attacks of Table 1", columns, body, _BESIDE)


def failures(outcomes: Sequence[Outcome]) -> list[str]:
    """Return a sentence for every reason why results are missing, with the models and variants."""
    failed: dict[str, list[str]] = {}
    for o in outcomes:
        for name, reason in o.failures.items():
            failed.setdefault(reason, []).append(f"{name} on {model_name(o.scheme, o.folder)}")
    return [f"Without results: {'; '.join(names)} ({reason})." for reason, names in failed.items()]


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
