"""The tables of models: every variant with its metrics, means over scenes, and these beside the paper's."""

from collections.abc import Callable, Iterable, Sequence
from math import isfinite, nan
from typing import Final

from gspure.evaluation.collecting import REMOVED
from gspure.evaluation.matched import titles_with_damage
from gspure.evaluation.outcomes import Outcome, by_model, ordered
from gspure.evaluation.paper import Beside
from gspure.evaluation.summary import summarize
from gspure.grouping import grouped
from gspure.metrics.detection import Detection
from gspure.metrics.image_metrics import METRICS
from gspure.metrics.names import UNATTACKED, display_name, extraction_name
from gspure.metrics.statistics import Interval
from gspure.metrics.targets import MESSAGE, SCENE, is_picture
from gspure.report.table import Cell, Column, Row, Table, few, interval, markdown_document
from gspure.text import UNKNOWN, decimal, percent, signed, significant

SHARES: Final = ("pruned_share", "precision", "recall")
_MODEL: Final = (
    "PSNR in dB, mean over views, against photographs or, without these, renders of the unattacked model (∞: "
    "identical); in parentheses, the change from the unattacked model, without photographs estimated. Score: drop of "
    "the message's PSNR minus that of the scene; the highest is in bold. Region PSNR: without the reference's most "
    "frequent colour. NC: normalized correlation. GC: gradient correlation. TPR: true positive rate over the views at "
    "this false positive rate. Precision: share of the pruned rows that carry the message. Recall: share of the "
    "message's rows that were pruned. †: the attack changed nothing that this extraction reads."
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
    document = markdown_document({model.title: [model_table(group)] for model, group in by_model(outcomes).items()})
    return "\n".join([document, *(f"{sentence}\n" for sentence in failures(outcomes))])


def model_table(outcomes: Sequence[Outcome]) -> Table:
    """Return every variant of one model with its metrics."""
    measured = [o for o in outcomes if not o.failure]
    names, targets = titles_with_damage(measured), ordered({target for o in measured for target in o.targets})
    best = max((o.score for o in measured if isfinite(o.score)), default=nan)
    detectors = {name: read.bits for o in measured for name, read in o.detections.items()}
    columns = {Column("variant"): [Cell(names[o.variant]) for o in measured]}
    if any(o.strength_text for o in measured):
        columns[Column("strength", main=False)] = [Cell(o.strength_text or UNKNOWN) for o in measured]
    for target in targets:
        for metric in METRICS:
            is_main = target in (SCENE, MESSAGE) and metric == "psnr"
            column = Column(METRICS[metric].title, display_name(target), main=is_main)
            columns[column] = [_metric(o, target, metric) for o in measured]
    for i, target in enumerate(filter(is_picture, targets)):
        scores = [o.score_of(target) for o in measured]
        column = Column(display_name(target), "Score", main=target == MESSAGE)
        columns[column] = [Cell(signed(score), best=not i and score == best) for score in scores]
    for name, bits in detectors.items():
        group, reads = display_name(name), [o.detections.get(name) for o in measured]
        columns[Column("correct bits" if bits else "score", group)] = [*map(_reading, reads)]
        for title, rate in (("TPR 1%", "tpr"), ("TPR 0.1%", "tpr_strict")):
            rates = [getattr(read, rate, nan) for read in reads]  # unknown where nothing was read
            columns[Column(title, group, main=rate == "tpr")] = [Cell(percent(value)) for value in rates]
    for name in SHARES:
        if any(map(isfinite, shares := [getattr(o, name) for o in measured])):
            column = Column(name.removesuffix("_share"), main=name == "pruned_share")
            columns[column] = [Cell(percent(share)) for share in shares]
    rows = [
        Row(cells, "control" if o.is_control else "best" if o.score == best else "")
        for o, cells in zip(measured, zip(*columns.values(), strict=True), strict=True)
    ]
    return Table("Metrics of every variant", [*columns], rows, _MODEL)


def _metric(o: Outcome, target: str, name: str) -> Cell:
    """Return a metric of one target, PSNR with its change against the unattacked model."""
    if target not in o.targets:
        return Cell(REMOVED) if name == "psnr" and target in o.unreadable else Cell()
    text = METRICS[name].text(o.targets[target].values[name])
    if name != "psnr":
        return Cell(text)
    missed, drop = o.variant != UNATTACKED and o.reaches(target) is False, o.psnr_drop(target)
    return Cell(text + " †" * missed, f"({signed(-drop)})" if isfinite(drop) and drop != 0 else "")


def _reading(read: Detection | None) -> Cell:
    """Return the mean reading of a detector with its standard deviation."""
    if read is None:
        return Cell()
    level = percent(read.level / 100) if read.bits else significant(read.level)
    return Cell(level, f"(± {significant(read.spread, 2)})")


def summary_table(outcomes: Sequence[Outcome]) -> Table:
    """Return the means over scenes, with what the paper prints for its scenes."""
    titles = ("Scenes", "Scene", "Message", "Score", "Score [paper]")
    columns = [Column("Scheme"), Column("Attack", text=True), *map(Column, titles)]
    rows, body = summarize(outcomes), []
    for condition, alike in grouped(rows, lambda row: row.condition).items():
        names = titles_with_damage(o for o in outcomes if o.condition == condition)
        for i, row in enumerate(alike):
            extraction = "" if row.extraction == MESSAGE else f", {extraction_name(row.extraction)}"
            shown = [Cell("" if i else condition.title), Cell(names[row.variant] + extraction)]
            scenes = scenes_of((row.scene, row.message, row.score))
            means = [
                Cell(text(value.mean), few(value.scenes, scenes)) if value else Cell()
                for value, text in ((row.scene, decimal), (row.message, text_of(row.extraction)))
            ]
            numbers = [*means, interval(row.score, scenes), Cell(decimal(row.paper_score))]
            body.append(Row([*shown, Cell(f"{scenes}"), *numbers], begins=not i))
    return Table("Means over scenes", columns, body, _SUMMARY)


def beside_table(rows: Sequence[Beside]) -> Table:
    """Return the attacks of the paper's Table 1 beside ours."""
    quantities = ("scene drop", "message drop", "Score", "RMS ratio")
    pairs = [Column(source, name) for name in quantities for source in ("paper", "ours")]
    body = []
    for condition, group in grouped(rows, lambda row: row.condition).items():
        for i, row in enumerate(group):
            names = [Cell("" if i else condition.title), Cell(display_name(row.variant))]
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
            failed.setdefault(reason, []).append(f"{name} on {o.model.title}")
    return [f"Without results: {'; '.join(names)} ({reason})." for reason, names in failed.items()]


def text_of(extraction: str) -> Callable[[float], str]:
    """Return how to write numbers of an extraction: dB with fixed decimals; scores of detectors have any magnitude."""
    return decimal if is_picture(extraction) else significant


def scenes_of(intervals: Iterable[Interval | None]) -> int:
    """Return the number of scenes behind some means; 0 if none is known."""
    return max((value.scenes for value in intervals if value), default=0)
