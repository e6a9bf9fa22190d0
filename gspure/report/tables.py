"""The tables of models: every variant with its metrics."""

from collections.abc import Sequence
from math import isfinite, nan
from typing import Final

from gspure.evaluation.collecting import REMOVED
from gspure.evaluation.outcomes import Outcome, by_model, ordered, titles_with_damage
from gspure.metrics.detection import Detection
from gspure.metrics.image_metrics import METRICS
from gspure.metrics.names import UNATTACKED, display_name
from gspure.metrics.targets import MESSAGE, SCENE
from gspure.report.table import Cell, Column, Table, TableRow, markdown_document
from gspure.text import UNKNOWN, percent, signed, significant

_MODEL: Final = (
    "PSNR in dB, mean over views, against photographs or, without these, renders of the unattacked model (∞: "
    "identical); in parentheses, the change from the unattacked model. †: the attack changed nothing that this "
    "extraction reads."
)
_TPR: Final = " TPR: true positive rate over the views at this false positive rate."


def results_markdown(outcomes: Sequence[Outcome]) -> str:
    """Return one table per model, and the reason of every failure."""
    tables = {model.title: [model_table(variants)] for model, variants in by_model(outcomes).items()}
    sentences = [f"{sentence}\n" for sentence in failures(outcomes)]
    return "\n".join([markdown_document(tables), *sentences])


def model_table(outcomes: Sequence[Outcome]) -> Table:
    """Return every variant of one model with its metrics."""
    measured = [o for o in outcomes if not o.failure]
    names = titles_with_damage(measured)
    columns = {Column("variant"): [Cell(names[o.variant]) for o in measured]}
    if any(o.strength for o in measured):
        columns[Column("strength", main=False)] = [Cell(o.strength_text or UNKNOWN) for o in measured]
    columns |= _metric_columns(measured)
    columns |= _detector_columns(measured)
    columns[Column("pruned")] = [Cell(percent(o.pruned_share)) for o in measured]
    cells = zip(*columns.values(), strict=True)
    rows = [TableRow(line, "control" if o.is_control else "") for o, line in zip(measured, cells, strict=True)]
    note = _MODEL + _TPR if any(o.detections for o in measured) else _MODEL
    return Table("Metrics of every variant", [*columns], rows, note)


def _metric_columns(measured: Sequence[Outcome]) -> dict[Column, list[Cell]]:
    """Return the metrics of every target."""
    targets = ordered({target for o in measured for target in o.targets})
    columns = {}
    for target in targets:
        for metric in METRICS:
            is_main = target in (SCENE, MESSAGE) and metric == "psnr"
            column = Column(METRICS[metric].title, display_name(target), main=is_main)
            columns[column] = [_metric(o, target, metric) for o in measured]
    return columns


def _detector_columns(measured: Sequence[Outcome]) -> dict[Column, list[Cell]]:
    """Return the readings of every detector, and its true positive rates."""
    bits_of = {name: detection.bits for o in measured for name, detection in o.detections.items()}
    columns = {}
    for name, bits in bits_of.items():
        group = display_name(name)
        detections = [o.detections.get(name) for o in measured]
        columns[Column("correct bits" if bits else "score", group)] = [*map(_reading, detections)]
        for title, rate in (("TPR 1%", "tpr"), ("TPR 0.1%", "tpr_strict")):
            rates = [getattr(detection, rate, nan) for detection in detections]  # unknown without a detection
            columns[Column(title, group, main=rate == "tpr")] = [Cell(percent(value)) for value in rates]
    return columns


def _metric(o: Outcome, target: str, name: str) -> Cell:
    """Return a metric of one target, PSNR with its change against the unattacked model."""
    if target not in o.targets:
        return Cell(REMOVED) if name == "psnr" and target in o.unreadable else Cell()
    text = METRICS[name].text(o.level(target, name))
    if name != "psnr":
        return Cell(text)
    if o.variant != UNATTACKED and o.reaches(target) is False:
        text += " †"
    drop = o.psnr_drop(target)
    return Cell(text, f"({signed(-drop)})" if isfinite(drop) and drop != 0 else "")


def _reading(detection: Detection | None) -> Cell:
    """Return the mean reading of a detector with its standard deviation."""
    if detection is None:
        return Cell()
    level = percent(detection.level / 100) if detection.bits else significant(detection.level)
    return Cell(level, f"(± {significant(detection.spread, 2)})")


def failures(outcomes: Sequence[Outcome]) -> list[str]:
    """Return a sentence for every reason why results are missing, with the models and variants."""
    failed: dict[str, list[str]] = {}
    for o in outcomes:
        for name, reason in o.failures.items():
            failed.setdefault(reason, []).append(f"{name} on {o.model.title}")
    return [f"Without results: {'; '.join(names)} ({reason})." for reason, names in failed.items()]
