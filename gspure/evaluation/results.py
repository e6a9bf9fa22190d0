"""The table ``results.csv``: outcomes of all variants, one row per target."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

from gspure.evaluation.collecting import REMOVED
from gspure.evaluation.identity import OfCondition
from gspure.evaluation.outcomes import Outcome, ordered, with_references
from gspure.evaluation.verdict import StrengthValue
from gspure.grouping import grouped
from gspure.metrics.comparison import RENDER, TRUTH, ViewMetrics
from gspure.metrics.csv_tables import Drops, Values, read_table, write_table
from gspure.metrics.detection import Detection
from gspure.metrics.retrieval import Retrieval
from gspure.metrics.targets import MESSAGE

_NONE: Final[Mapping[str, float]] = MappingProxyType({})


class Result(NamedTuple):
    """One target of one variant; for a variant or detector without results, only the reason."""

    condition: OfCondition
    scene: str
    seed: int
    variant: str
    entry: str = ""
    wanted: float = math.nan
    target: str = ""
    reference: Literal["truth", "render", ""] = ""
    views: int | None = None
    identical: int | None = None
    values: Values = _NONE
    drops: Drops = _NONE
    score: float = math.nan
    reached: bool | None = None
    pruned_share: float = math.nan
    precision: float = math.nan
    recall: float = math.nan
    strength: StrengthValue | None = None
    search_damage: float = math.nan
    failure: str = ""
    retrieval: Retrieval | None = None
    detection: Detection | None = None  # of a target that is a detector
    run: str = ""
    attack: str = ""  # what the variant is one strength of


def write_results(path: Path, outcomes: Sequence[Outcome], attacks: Mapping[str, Sequence[str]]) -> None:
    """Write one CSV row per target of every outcome; unknown numbers are empty. `attacks` name the variants of each."""
    attack_of = {variant: attack for attack, variants in attacks.items() for variant in variants}
    write_table(path, Result, (row for o in outcomes for row in _rows(o, attack_of.get(o.variant, ""))))


def read_results(*paths: Path) -> tuple[list[Outcome], dict[str, list[str]]]:
    """Return the outcomes and the variants of each attack, from tables of `write_results` of different pairs."""
    rows = [row for path in paths for row in read_table(path, Result)]
    of_variant = grouped(rows, lambda row: (row.condition, row.scene, row.seed, row.variant))
    attacks = dict[str, dict[str, None]]()
    for row in rows:
        attacks.setdefault(row.attack, {})[row.variant] = None
    outcomes = [_outcome(variant_rows) for variant_rows in of_variant.values()]
    return with_references(outcomes), {attack: [*variants] for attack, variants in attacks.items()}


def _outcome(rows: Sequence[Result]) -> Outcome:
    """Return the outcome of a variant from its rows."""
    first = rows[0]
    measured = [row for row in rows if row.reference]
    errors = {row.target: row.failure for row in rows if row.target and row.failure}
    return Outcome(
        scheme=first.condition.scheme,
        scene=first.scene,
        variant=first.variant,
        targets={row.target: ViewMetrics(row.target, "mean", row.reference or TRUTH, row.values) for row in measured},
        views={row.target: row.views or 0 for row in measured},
        pruned_share=first.pruned_share,
        precision=first.precision,
        recall=first.recall,
        entry=first.entry,
        wanted=first.wanted,
        strength=first.strength,
        search_damage=first.search_damage,
        affects={row.target: row.reached for row in rows if row.reached is not None},
        failure="" if first.target else first.failure,
        identical={row.target: row.identical for row in measured if row.identical is not None},
        retrieval={row.target: row.retrieval for row in measured if row.retrieval},
        detections={row.target: row.detection for row in rows if row.detection},
        nominal={row.target: row.drops.get("psnr", math.nan) for row in measured if row.reference == RENDER},
        detector_errors={target: reason for target, reason in errors.items() if not reason.startswith(REMOVED)},
        unreadable={target: reason for target, reason in errors.items() if reason.startswith(REMOVED)},
        seed=first.seed,
        protocol=first.condition.protocol,
        initialization=first.condition.initialization,
        run=first.run,
    )


def _rows(o: Outcome, attack: str) -> Iterator[Result]:
    row = Result(o.condition, o.scene, o.seed, o.variant, entry=o.entry, wanted=o.wanted, run=o.run, attack=attack)
    if o.failure:
        yield row._replace(failure=o.failure)
    for target in ordered(o.targets):
        mean = o.targets[target]
        yield row._replace(
            target=target,
            reference=mean.reference,
            views=o.views[target],
            identical=o.identical.get(target),
            values=mean.values,
            drops=o.drops(target),
            score=o.score_of(target if target in o.messages else MESSAGE),
            reached=o.affects.get(target),
            pruned_share=o.pruned_share,
            precision=o.precision,
            recall=o.recall,
            strength=o.strength,
            search_damage=o.search_damage,
            retrieval=o.retrieval.get(target),
        )
    errors = {**o.detector_errors, **o.unreadable}
    for name in ordered({*o.detections, *errors}):
        yield row._replace(
            target=name,
            failure=errors.get(name, ""),
            detection=o.detections.get(name),
            reached=o.affects.get(name),
        )
