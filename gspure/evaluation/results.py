"""The long table ``results.csv``: one row per model, variant and target."""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Final, Literal, NamedTuple

from gspure.errors import InputError
from gspure.evaluation.comparison import RENDER, ViewMetrics
from gspure.evaluation.csv_tables import PerMetric, Values, grouped, read_table, write_table
from gspure.evaluation.detection import Detection
from gspure.evaluation.metrics import METRICS
from gspure.evaluation.outcomes import MESSAGE, Outcome, condition_of, ordered, with_references
from gspure.evaluation.retrieval import Retrieval
from gspure.settings import Share

_NONE: Final[Mapping[str, float]] = MappingProxyType({})


class Result(NamedTuple):
    """One target of one variant; for a variant or detector that failed, only the reason."""

    scheme: str
    protocol: str
    initialization: str
    scene: str
    seed: int
    variant: str
    target: str = ""
    reference: Literal["truth", "render", ""] = ""
    views: int | None = None
    identical: int | None = None
    values: Values = _NONE
    drops: Annotated[Mapping[str, float], PerMetric("{}_drop", differences=True)] = _NONE
    score: float = math.nan
    reached: bool | None = None
    pruned_share: Share = math.nan
    precision: Share = math.nan
    recall: Share = math.nan
    strength: str = ""
    failure: str = ""
    off_path: Annotated[Mapping[str, float], PerMetric("off_path_{}")] = _NONE
    off_path_psnr_drop: float = math.nan
    off_path_score: float = math.nan
    retrieval: Retrieval | None = None
    detection: Detection | None = None  # of a target that is a detector


def write_results(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Write one CSV row per target of every outcome; unknown numbers are empty."""
    write_table(path, Result, (row for outcome in outcomes for row in _rows(outcome)))


def read_results(path: Path) -> list[Outcome]:
    """Return the outcomes that `write_results` has written; the rows of one need not be adjacent.

    Raise `InputError` if the file is not such a table, has two rows for the same target of the same variant, or a model
    under two conditions.
    """
    rows = read_table(path, Result)
    keys = Counter((*condition_of(row), row.scene, row.seed, row.variant, row.target) for row in rows)
    for key in (key for key, count in keys.items() if count > 1):
        raise InputError(path, "rows", expected="one for every target of every variant", found=f"{keys[key]} of {key}")
    for row in (row for row in rows if row.values and "psnr" not in row.values):
        raise InputError(path, "psnr", expected="a number beside other metrics", found=f"none for {row.variant}")
    for (scheme, scene), of_model in grouped(rows, lambda row: (row.scheme, row.scene)).items():
        if len(conditions := {condition_of(row) for row in of_model}) > 1:
            found = " and ".join(sorted(" ".join(condition[1:]) for condition in conditions))
            hint = "tables of two runs? rename the scenes of one"
            raise InputError(path, f"{scheme}/{scene}", expected="one condition", found=found, hint=hint)
    variants = grouped(rows, lambda row: (condition_of(row), row.scene, row.seed, row.variant))
    return with_references(_outcome(targets) for targets in variants.values())


def _rows(o: Outcome) -> Iterator[Result]:
    if o.failure:
        yield Result(*o.condition, o.scene, o.seed, o.variant, failure=o.failure)
    off = o.off_path_outcome()
    for target in ordered(o.targets):
        mean, extraction = o.targets[target], target if target in o.messages else MESSAGE
        is_measured = target in off.targets
        yield Result(
            *o.condition,
            o.scene,
            o.seed,
            o.variant,
            target,
            mean.reference,
            o.views[target],
            o.identical.get(target),
            mean.values,
            o.drops(target),
            o.score_of(extraction),
            o.reached.get(target),
            o.pruned_share,
            o.precision,
            o.recall,
            o.strength,
            off_path=off.targets[target].values if is_measured else {},
            off_path_psnr_drop=off.psnr_drop(target),
            off_path_score=off.score_of(extraction) if is_measured else math.nan,
            retrieval=o.retrieval.get(target),
        )
    for name in ordered({*o.detections, *o.undetected}):
        row = Result(*o.condition, o.scene, o.seed, o.variant, name, failure=o.undetected.get(name, ""))
        yield row._replace(detection=o.detections.get(name), reached=o.reached.get(name))


def _outcome(rows: list[Result]) -> Outcome:
    first, measured = rows[0], [row for row in rows if row.values]
    return Outcome(
        first.scheme,
        first.scene,
        first.variant,
        {row.target: _mean(row, row.values) for row in measured},
        {row.target: row.views or 0 for row in measured},
        pruned_share=first.pruned_share,
        precision=first.precision,
        recall=first.recall,
        reached={row.target: row.reached for row in rows if row.reached is not None},
        strength=first.strength,
        failure=next((row.failure for row in rows if not row.target), ""),
        identical={row.target: row.identical for row in measured if row.identical is not None},
        off_path={row.target: _mean(row, row.off_path) for row in rows if row.off_path},
        retrieval={row.target: row.retrieval for row in rows if row.retrieval},
        detections={row.target: row.detection for row in rows if row.detection},
        undetected={row.target: row.failure for row in rows if row.target and row.failure},
        seed=first.seed,
        protocol=first.protocol,
        initialization=first.initialization,
    )


def _mean(row: Result, values: Values) -> ViewMetrics:
    complete = dict.fromkeys(METRICS, math.nan) | dict(values)  # a table of one's own may have PSNR only
    return ViewMetrics(row.target, "mean", row.reference or RENDER, complete)
