"""Outcomes from a folder of results: what is there, and why the rest is missing."""

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from gspure.arrays import load_array
from gspure.codec import read
from gspure.errors import InputError, printable
from gspure.evaluation.attack_record import ATTACK_RECORD, Applied, AttackRecord, Refused
from gspure.evaluation.evidence import EVIDENCE, JobEvidence
from gspure.evaluation.outcomes import Outcome, by_model, with_references
from gspure.evaluation.plan import AttackSpec, Job, ModelPlan
from gspure.files import read_json
from gspure.grouping import grouped
from gspure.metrics.comparison import TRUTH, ViewMetrics, identical, means, read_metrics
from gspure.metrics.detection import DETECTIONS, Detection, read_detections
from gspure.metrics.names import UNATTACKED
from gspure.metrics.targets import needs_rows
from gspure.progress import warn
from gspure.provenance import run_of

REMOVED: Final = "removed"  # why no extraction can read the attacked model
_ERROR: Final = re.compile(r"gspure \S+: |killed by signal|\S*(Error|Exception|Interrupt)\b")


def collect(results: Path, models: Sequence[ModelPlan]) -> list[Outcome]:
    """Return the outcomes of all variants and controls of models, sorted by model; `UNATTACKED` first.

    Where a file is missing, the outcome names the reason: that the attack cannot apply, or the last line of a log.
    """
    if not models:
        raise InputError(results, "models", expected="some model", found="none")
    outcomes = [outcome for model in models for outcome in _of_model(results, model)]
    for model, variants in by_model(outcomes).items():
        runs = {o.run for o in variants if o.run and not o.is_control}
        if len(runs) > 1:
            warn(f"{model.title}: results of {len(runs)} runs: {', '.join(sorted(runs))}")
    outcomes.sort(key=lambda o: (o.scheme, o.scene, o.seed, o.variant != UNATTACKED))
    return with_references(outcomes)


@dataclass(frozen=True)
class _Files:
    """The files of a job that are there, and the reasons for those that are missing."""

    folder: Path
    attack: Applied | Refused | None
    missing: Mapping[str, str]  # reasons by file

    @property
    def is_measured(self) -> bool:
        """Whether there are metrics."""
        return "metrics.csv" not in self.missing and (self.folder / "metrics.csv").is_file()


def expected_files(job: Job) -> list[str]:
    """Return the files of a job that its outcome needs."""
    files = [f"{DETECTIONS}/{name}.csv" for name in (*job.detectors, *job.bit_targets)]
    if job.control is None or job.compared:
        files.insert(0, "metrics.csv")
    return files


def _of_model(results: Path, model: ModelPlan) -> Iterator[Outcome]:
    place = results / model.id.name
    jobs = [job for job in model.jobs if expected_files(job)]
    files = {job.variant: _files(results, place / job.variant, job) for job in jobs}
    measured = [job.variant for job in jobs if files[job.variant].is_measured]
    metrics = _without_identical_views({name: read_metrics(place / name / "metrics.csv") for name in measured})
    detections = read_detections(place)
    for job in jobs:
        outcome = _unmeasured_outcome(model, job, files[job.variant], detections.get(job.variant, {}))
        evidence = _evidence(place / job.variant)
        outcome = replace(outcome, evidence=evidence.pictures, bits=evidence.bits, change=evidence.scene)
        if job.variant in metrics:
            outcome = replace(outcome, **_metric_fields(place / job.variant, metrics[job.variant]))
        yield outcome


def _files(results: Path, folder: Path, job: Job) -> _Files:
    """Return the state of a job's files; an attack that cannot apply has none."""
    attack = None
    if (folder / ATTACK_RECORD).is_file():
        record: AttackRecord = read(AttackRecord, read_json(folder / ATTACK_RECORD), folder / ATTACK_RECORD)
        attack = record.attack
    if isinstance(attack, Refused):
        return _Files(folder, attack, dict.fromkeys(expected_files(job), f"not applicable: {attack.reason}"))
    absent = [file for file in expected_files(job) if not (folder / file).is_file()]
    reason = _reason(results, folder) if absent else ""
    return _Files(folder, attack, dict.fromkeys(absent, reason))


def _unmeasured_outcome(model: ModelPlan, job: Job, files: _Files, detections: Mapping[str, Detection]) -> Outcome:
    """Return what is known of a job without its metrics."""
    errors = {Path(file).stem: reason for file, reason in files.missing.items() if file != "metrics.csv"}
    outcome = Outcome(
        scheme=model.id.scheme,
        scene=model.id.scene,
        variant=job.variant,
        failure=files.missing.get("metrics.csv", ""),
        detector_errors=errors,
        detections=detections,
        seed=model.id.seed,
        protocol=model.condition.protocol,
        initialization=model.condition.initialization,
        run=run_of(files.folder / "public") or run_of(files.folder) or run_of(files.folder.parent / "public"),
    )
    if isinstance(job.case, AttackSpec):
        wanted = math.nan if job.case.damage is None else job.case.damage
        outcome = replace(outcome, entry=job.case.entry, wanted=wanted)
    attack = files.attack
    if not isinstance(attack, Applied) or not files.is_measured:
        return outcome
    extracted = filter(needs_rows, (*model.targets, *job.bit_targets))
    unreadable = dict.fromkeys(extracted, f"{REMOVED}: {attack.removed}") if attack.removed else {}
    return replace(
        outcome,
        detector_errors={name: reason for name, reason in errors.items() if name not in unreadable},
        strength=attack.strength,
        search_damage=math.nan if attack.search_damage is None else attack.search_damage,
        affects=attack.affects,
        unreadable=unreadable,
    )


def _evidence(folder: Path) -> JobEvidence:
    """Return the evidence of a job, which controls without metrics have, too; none if it is not there."""
    if not (folder / EVIDENCE).is_file():
        return JobEvidence()
    evidence: JobEvidence = read(JobEvidence, read_json(folder / EVIDENCE), folder / EVIDENCE)
    return evidence


def _metric_fields(folder: Path, rows: Sequence[ViewMetrics]) -> dict[str, Any]:
    """Return the fields of an outcome from the files of a variant's folder."""
    targets = {mean.target: mean for mean in means(rows)}
    same = identical(rows)
    fields: dict[str, Any] = {
        "targets": targets,
        "views": Counter(row.target for row in rows),
        "identical": {name: same[name] for name in targets},
    }
    mask_file = folder / "prune_mask.npy"
    if mask_file.is_file():
        pruned = load_array(mask_file, dtype=np.bool_, shape=(None,))
        fields["pruned_share"] = float(np.mean(pruned))
    return fields


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
    """Drop views whose PSNR is infinite in any variant, so that all variants average the same views.

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
