"""Outcomes from a folder of results: what is there, and why the rest is missing; and their table, ``results.csv``."""

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from gspure.arrays import load_array
from gspure.errors import InputError, printable
from gspure.evaluation.matched import Sweeps
from gspure.evaluation.outcomes import OfCondition, Outcome, by_model, ordered, with_references
from gspure.files import read_json
from gspure.grouping import grouped
from gspure.metrics.comparison import RENDER, TRUTH, ViewMetrics, identical, means, read_metrics
from gspure.metrics.csv_tables import Drops, Values, read_table, write_table
from gspure.metrics.detection import DETECTIONS, Detection, read_detections
from gspure.metrics.image_metrics import nominal_drop
from gspure.metrics.names import UNATTACKED, model_name
from gspure.metrics.retrieval import Retrieval, Retrieved
from gspure.metrics.targets import MESSAGE, SCENE
from gspure.progress import warn
from gspure.provenance import run_of

MESSAGE_ROWS: Final = "message_rows.npy"  # file of a key, of schemes that know which rows carry the message: bool [K]
_REFUSED: Final = "not applicable"  # entry of ``verdict.json``: why an attack cannot apply to a model
REMOVED: Final = "removed"  # entry of ``verdict.json``: why no extraction can read the attacked model
_ERROR: Final = re.compile(r"gspure \S+: |killed by signal|\S*(Error|Exception|Interrupt)\b")
_NONE: Final[Mapping[str, float]] = MappingProxyType({})


@dataclass(frozen=True)
class ModelPlan:
    """What a run makes of one model, in ``results/SCHEME/SCENE``.

    `variants` and `controls` have metrics, in the order of tables, the unattacked model first. `detections` are the
    detectors that read each of them, or further controls. `targets` are the pictures that are compared, the scene and
    extractions of the message; `photographs` the folder with their truth, ``scene`` and ``message``, or None if renders
    are compared with those of the unattacked model. Protocol and initialization are those of its pair.
    """

    variants: Sequence[str]
    controls: Sequence[str] = ()
    targets: Sequence[str] = (SCENE,)
    detections: Mapping[str, Sequence[str]] = field(default_factory=dict)
    photographs: Path | None = None
    protocol: str = ""
    initialization: str = ""

    @property
    def expected(self) -> dict[str, Sequence[str]]:
        """The files that every variant and control should have."""
        measured = (*self.variants, *self.controls)
        return {
            name: [
                *["metrics.csv"] * (name in measured),
                *(f"{DETECTIONS}/{detector}.csv" for detector in self.detections.get(name, ())),
            ]
            for name in dict.fromkeys((*measured, *self.detections))
        }


def collect(results: Path, models: Mapping[str, ModelPlan]) -> list[Outcome]:
    """Return the outcomes of all variants of models ``SCHEME/SCENE``, sorted by these; `UNATTACKED` first.

    Scenes that end in ``@1``, ``@2``, ... are repetitions with other random seeds. Where a file is missing, the outcome
    names the reason: that the attack cannot apply, or the last line of a log.
    """
    if not models:
        raise InputError(results, "models", expected="some model", found="none")
    outcomes = [o for name, plan in models.items() for o in _of_model(results, name, plan)]
    for (scheme, folder), variants in by_model(outcomes):
        if len(runs := {o.run for o in variants if o.run and not o.is_control}) > 1:
            warn(f"{model_name(scheme, folder)}: results of {len(runs)} runs: {', '.join(sorted(runs))}")
    outcomes.sort(key=lambda o: (o.scheme, o.scene, o.seed, o.variant != UNATTACKED))
    return with_references(outcomes)


def _of_model(results: Path, name: str, plan: ModelPlan) -> Iterator[Outcome]:
    scheme, folder = name.split("/")
    scene, _, seed = folder.partition("@")
    place = results / scheme / folder
    files = {variant: place / variant / "verdict.json" for variant in plan.expected}
    verdicts = {variant: read_json(file) if file.is_file() else {} for variant, file in files.items()}
    refused = {v: f"{_REFUSED}: {verdict[_REFUSED]}" if _REFUSED in verdict else "" for v, verdict in verdicts.items()}
    tables = {v: path for v in plan.expected if not refused[v] and (path := place / v / "metrics.csv").is_file()}
    rows = _without_identical_views({variant: read_metrics(path) for variant, path in tables.items()})
    detections = read_detections(place)
    for variant, expected in plan.expected.items():
        absent = [file for file in expected if refused[variant] or not (place / variant / file).is_file()]
        missing = {file: refused[variant] or _reason(results, place / variant) for file in absent}
        o = Outcome(
            scheme,
            scene,
            variant,
            failure=missing.pop("metrics.csv", ""),
            undetected={Path(file).stem: reason for file, reason in missing.items()},
            detections=detections.get(variant, {}),
            seed=int(seed) if seed.isdecimal() else 0,
            protocol=plan.protocol,
            initialization=plan.initialization,
            run=run_of(place / variant / "public") or run_of(place / variant) or run_of(place / "public"),
        )
        if variant in rows:
            verdict = dict(verdicts[variant])
            if reason := verdict.pop(REMOVED, ""):
                verdict["undetected"] = {**o.undetected} | dict.fromkeys(plan.targets[1:], f"{REMOVED}: {reason}")
            truth_file = place / "key" / MESSAGE_ROWS if variant in plan.variants else None
            o = replace(o, **verdict, **_measured(place / variant, rows[variant], truth_file))
        yield o


def _measured(folder: Path, rows: Sequence[ViewMetrics], truth_file: Path | None) -> dict[str, Any]:
    """Return the fields of an outcome from the files of a variant's folder."""
    targets, same = {mean.target: mean for mean in means(rows)}, identical(rows)
    known: dict[str, Any] = {"targets": targets, "views": Counter(row.target for row in rows)}
    known["identical"] = {name: same[name] for name in targets}
    rendered = grouped((row for row in rows if row.reference == RENDER), lambda row: row.target)
    known["nominal"] = {name: float(np.mean([nominal_drop(row.psnr) for row in of])) for name, of in rendered.items()}
    if (table := folder / "retrieval.csv").is_file():
        known["retrieval"] = {row.target: row.retrieval for row in read_table(table, Retrieved)}
    if (mask := folder / "prune_mask.npy").is_file():
        pruned = load_array(mask, dtype=np.bool_, shape=(None,))
        known["pruned_share"] = float(np.mean(pruned))
        if truth_file and truth_file.is_file():
            truth = load_array(truth_file, dtype=np.bool_, shape=(len(pruned),))
            known["precision"], known["recall"] = (
                np.count_nonzero(pruned & truth) / count if (count := int(mask.sum())) else math.nan
                for mask in (pruned, truth)
            )
    return known


def _reason(results: Path, variant: Path) -> str:
    """Return why files of a variant are missing: the last line of the failed job's log.

    The logs of the variant count first, then those of its model, the newest first.
    """
    for folder in (variant, variant.parent):
        logs = [*(results / "logs" / folder.relative_to(results)).glob("*.log")]
        for log in sorted(logs, key=lambda path: path.stat().st_mtime, reverse=True):
            lines = [line.strip() for line in log.read_text(encoding="utf-8", errors="replace").splitlines()]
            line = next(filter(None, reversed(lines)), "")
            if _ERROR.match(line):
                return printable(line.replace("killed", f"{log.stem} was killed"))
    return "not run"


def _without_identical_views(rows_of: Mapping[str, list[ViewMetrics]]) -> dict[str, list[ViewMetrics]]:
    """Leave out the views of a model that equal their photograph in some variant: no mean PSNR counts them there.

    Where none is left, variants with such views keep them alone: their mean PSNR is infinite, and their drop unknown.
    """
    exact = {variant: [row for row in rows if _equals_photograph(row)] for variant, rows in rows_of.items()}
    equal = {(row.target, row.view) for rows in exact.values() for row in rows}
    kept: dict[str, list[ViewMetrics]] = {}
    for variant, rows in rows_of.items():
        kept[variant] = []
        for views in grouped(rows, lambda row: row.target).values():
            others = [row for row in views if (row.target, row.view) not in equal]
            kept[variant] += others or [row for row in views if row in exact[variant]] or views
    return kept


def _equals_photograph(row: ViewMetrics) -> bool:
    return row.reference == TRUTH and not math.isfinite(row.psnr)


class Result(NamedTuple):
    """One target of one variant; for a variant or detector without results, only the reason."""

    condition: OfCondition
    scene: str
    seed: int
    variant: str
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
    strength: str = ""
    failure: str = ""
    retrieval: Retrieval | None = None
    detection: Detection | None = None  # of a target that is a detector
    run: str = ""
    attack: str = ""  # what the variant is one strength of


def write_results(path: Path, outcomes: Sequence[Outcome], attacks: Sweeps) -> None:
    """Write one CSV row per target of every outcome; unknown numbers are empty. `attacks` name the variants of each."""
    of = {variant: attack for attack, variants in attacks.items() for variant in variants}
    write_table(path, Result, (row for o in outcomes for row in _rows(o, of.get(o.variant, ""))))


def read_results(*paths: Path) -> tuple[list[Outcome], dict[str, list[str]]]:
    """Return the outcomes and the variants of each attack, from tables of `write_results` of different pairs."""
    outcomes, attacks = [], dict[str, dict[str, None]]()
    of_variant = grouped(
        (row for path in paths for row in read_table(path, Result)),
        lambda row: (row.condition, row.scene, row.seed, row.variant),
    )
    for (condition, scene, seed, variant), rows in of_variant.items():
        measured, first = [row for row in rows if row.reference], rows[0]
        attacks.setdefault(first.attack, {})[variant] = None
        o = Outcome(
            condition.scheme,
            scene,
            variant,
            {row.target: ViewMetrics(row.target, "mean", row.reference or TRUTH, row.values) for row in measured},
            {row.target: row.views or 0 for row in measured},
            *(first.pruned_share, first.precision, first.recall),
            reached={row.target: row.reached for row in rows if row.reached is not None},
            strength=first.strength,
            failure="" if first.target else first.failure,
            identical={row.target: row.identical for row in measured if row.identical is not None},
            retrieval={row.target: row.retrieval for row in measured if row.retrieval},
            detections={row.target: row.detection for row in rows if row.detection},
            nominal={row.target: row.drops.get("psnr", math.nan) for row in measured if row.reference == RENDER},
            undetected={row.target: row.failure for row in rows if row.target and row.failure},
            seed=seed,
            protocol=condition.protocol,
            initialization=condition.initialization,
            run=first.run,
        )
        outcomes.append(o)
    return with_references(outcomes), {attack: [*variants] for attack, variants in attacks.items()}


def _rows(o: Outcome, attack: str) -> Iterator[Result]:
    row = Result(o.condition, o.scene, o.seed, o.variant, run=o.run, attack=attack)
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
            reached=o.reached.get(target),
            pruned_share=o.pruned_share,
            precision=o.precision,
            recall=o.recall,
            strength=o.strength,
            retrieval=o.retrieval.get(target),
        )
    for name in ordered({*o.detections, *o.undetected}):
        found = row._replace(target=name, failure=o.undetected.get(name, ""))
        yield found._replace(detection=o.detections.get(name), reached=o.reached.get(name))
