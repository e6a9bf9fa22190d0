"""The outcome of a variant: metrics of scene and message, and precision and recall of its pruning."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np

from gspure.artifacts import embedding_of, load_array, place, read_json, require_embedding
from gspure.errors import InputError
from gspure.evaluation.comparison import TRUTH, ViewMetrics, identical, means, off_path, on_path, read_metrics
from gspure.evaluation.controls import BASELINES, CONTROLS
from gspure.evaluation.csv_tables import grouped, read_table
from gspure.evaluation.detection import DETECTIONS, Detection, read_detections, variant_of
from gspure.evaluation.intervals import difference
from gspure.evaluation.metrics import METRICS
from gspure.evaluation.names import GSPURE, UNATTACKED, display_name
from gspure.evaluation.origins import (
    require_equal_images,
    require_equal_references,
    require_equal_renders,
    require_one_origin,
    require_one_owner,
    require_origins,
    require_same_renders,
)
from gspure.evaluation.recall import recall
from gspure.evaluation.retrieval import Retrieval, Retrieved
from gspure.failures import read_failure

SCENE, MESSAGE, BITS = "scene", "message", "bits"

UNCHANGED: Final = 0.05
"""Largest change of an extraction, dB or points, due to rounding, as of reordered rows. Ours."""


class Condition(NamedTuple):
    """What outcomes have in common that are averaged over scenes, and compared with each other."""

    scheme: str
    protocol: str = ""  # poses of the message's views, `shared` or `own`; empty for models of no pair
    initialization: str = ""  # whose points training starts from, `both` or `scene`; empty for models of no pair

    @property
    def key(self) -> str:
        """Its name in folders and options: ``gs_hider-own-both``."""
        return "-".join(filter(None, self))


def condition_of(row: Any) -> Condition:
    """Return the condition in the first columns of a row of means."""
    return Condition(row.scheme, row.protocol, row.initialization)


@dataclass(frozen=True)
class Outcome:
    """One variant of one model: its mean metrics by target, and the quality of its pruning.

    Unknown numbers are NaN. If images are compared with renders of the unattacked model, the PSNR of that model is
    infinite and drops from it are unknown.
    """

    scheme: str
    scene: str
    variant: str
    targets: Mapping[str, ViewMetrics]
    views: Mapping[str, int]
    pruned_share: float = math.nan
    precision: float = math.nan
    recall: float = math.nan
    reference: Mapping[str, ViewMetrics] = field(default_factory=dict)  # the same of the variant `UNATTACKED`
    reached: Mapping[str, bool] = field(default_factory=dict)  # by extraction: whether the attack changed its carrier
    strength: str = ""  # the attack's strength, `fraction=0.25`; empty if it has none
    failure: str = ""  # why there are no metrics; empty if there are
    off_path: Mapping[str, ViewMetrics] = field(default_factory=dict)  # `targets` over views off the camera path
    off_path_reference: Mapping[str, ViewMetrics] = field(default_factory=dict)  # the same of `UNATTACKED`
    identical: Mapping[str, int] = field(default_factory=dict)  # views of infinite PSNR, in no mean unless all are
    retrieval: Mapping[str, Retrieval] = field(default_factory=dict)  # by extraction of the message
    detections: Mapping[str, Detection] = field(default_factory=dict)  # by detector, of renders of the scene
    detections_before: Mapping[str, Detection] = field(default_factory=dict)  # the same for the variant `UNATTACKED`
    undetected: Mapping[str, str] = field(default_factory=dict)  # for each detector that failed, why
    seed: int = 0  # number of the repetition on the same scene, each with its own random seeds
    protocol: str = ""
    initialization: str = ""  # like `protocol`, see `Condition`

    @property
    def condition(self) -> Condition:
        """Its scheme, protocol and initialization."""
        return condition_of(self)

    @property
    def folder(self) -> str:
        """The folder of its model below the scheme: ``room``, or ``room@1`` for a repetition."""
        return f"{self.scene}@{self.seed}" if self.seed else self.scene

    def level(self, target: str, metric: str = "psnr") -> float:
        """Return the target's PSNR, dB, or another metric, or the mean reading of a detector; NaN if it is unknown."""
        if target in self.detections:
            return self.detections[target].level
        return self.targets[target].values[metric] if target in self.targets else math.nan

    def drop(self, target: str) -> float:
        """Return the drop of the target's level, relative to the unattacked model."""
        if target in self.detections and target in self.detections_before:
            return difference(self.detections_before[target].level, self.detections[target].level)
        return self.psnr_drop(target)

    def drops(self, target: str) -> dict[str, float]:
        """Return the drop of each metric of the target, relative to the unattacked model."""
        if target not in self.targets or target not in self.reference:
            return dict.fromkeys(METRICS, math.nan)
        before, after = self.reference[target].values, self.targets[target].values
        return {name: _difference(before[name], after[name]) for name in METRICS}

    def psnr_drop(self, target: str) -> float:
        r"""Return :math:`\Delta PSNR`, the drop of the target's PSNR relative to the unattacked model, in dB."""
        return self.drops(target)["psnr"]

    def reaches(self, extraction: str) -> bool | None:
        """Return whether the attack reached an extraction, by its declared carrier or its result; None if unknown.

        A result that changed shows that the declared carrier is incomplete (`contradicts`).
        """
        return self.contradicts(extraction) or self.reached.get(extraction)

    def contradicts(self, extraction: str) -> bool:
        """Return whether the extraction changed, although nothing in its declared carrier did."""
        before = replace(self, targets=self.reference, detections=self.detections_before).level(extraction)
        return self.reached.get(extraction) is False and abs(before - self.level(extraction)) > UNCHANGED

    @property
    def against_truth(self) -> bool:
        """Whether its metrics compare with photographs, not with renders of the unattacked model."""
        return all(mean.reference == TRUTH for mean in self.targets.values())

    @property
    def is_control(self) -> bool:
        """Whether it is a negative control (`gspure.evaluation.controls`)."""
        return self.variant in CONTROLS

    def is_flat(self, target: str) -> bool:
        """Return whether its images of the target are of one colour each: they correlate with no photograph."""
        return target in self.targets and self.targets[target].values["structure"] == 0

    def is_judged(self, extraction: str) -> bool:
        """Return whether its views suffice to tell whether the message is present; they always do for a picture."""
        return extraction not in self.detections or self.detections[extraction].present is not None

    @property
    def messages(self) -> list[str]:
        """The targets that are extractions of the message, the scheme's own first, and its detectors."""
        return ordered([*filter(is_picture, self.targets), *self.detections])

    def score_of(self, target: str) -> float:
        r"""Return the paper's measure of an attack, in dB; NaN for a control.

        .. math:: Score = \Delta PSNR_{message} - \Delta PSNR_{scene}

        (paper, §Metrics.) `target` is an extraction of the message.
        """
        return math.nan if self.is_control else self.psnr_drop(target) - self.psnr_drop(SCENE)

    @property
    def failures(self) -> dict[str, str]:
        """Why there are no metrics, or no readings of a detector, by what failed."""
        name = display_name(self.variant)
        failed = {name: self.failure} if self.failure else {}
        return failed | {f"{detector} of {name}": reason for detector, reason in self.undetected.items()}

    def off_path_outcome(self) -> Outcome:
        """Return this variant with the metrics of views off the camera path, where detectors read nothing."""
        return replace(self, targets=self.off_path, reference=self.off_path_reference, detections={})

    @property
    def score(self) -> float:
        """The Score of the extraction ``message``."""
        return self.score_of(MESSAGE)


def ordered(targets: Iterable[str]) -> list[str]:
    """Return targets in display order: the scene, the message, its other extractions, hidden bits, detectors."""
    return sorted(targets, key=lambda name: (name != SCENE, name != MESSAGE, not is_picture(name), name != BITS, name))


def is_picture(target: str) -> bool:
    """Return whether a target is an extraction that shows the message, not the scene or a detector."""
    return target.startswith(MESSAGE)


def collect(
    metrics: Sequence[Path],
    prune_masks: Sequence[Path] = (),
    truth: Sequence[Path] = (),
    verdicts: Sequence[Path] = (),
    failures: Sequence[Path] = (),
    retrievals: Sequence[Path] = (),
    detections: Sequence[Path] = (),
    conditions: Mapping[str, tuple[str, str]] = MappingProxyType({}),
    attacks: Collection[str] = (UNATTACKED, GSPURE),
) -> list[Outcome]:
    """Gather the outcomes of all variants, sorted by scheme and scene; within each, `UNATTACKED` first.

    `metrics` are files ``.../{scheme}/{scene}/{variant}/metrics.csv``; scenes that end in ``@1``, ``@2``, ... are
    repetitions with other random seeds. The others are optional, and belong to the model or variant below whose folder
    they lie: `prune_masks` and `truth` (rows that carry the message) are bool [K], `verdicts` of `gspure attack`,
    `retrievals` of `gspure retrieve`, `detections` of `gspure detect`. A variant or detector whose file is missing
    because of one of `failures` has failed for its reason. `conditions` are protocol and initialization by
    ``{scheme}/{scene}``. The names of `attacks` are reserved for these attacks.

    Raises
    ------
    InputError
        If a file cannot be read, two masks of one model have different lengths, a variant was measured in other views
        than the unattacked model or in other images than its retrieval or detections, or was rendered with other
        settings, a variant of a model occurs twice, variants are not comparable (`require_one_origin`), a condition is
        of no model (unless jobs failed), or every variant failed.
    """
    failed = _failed(failures)
    if not metrics:
        found = f"none: every variant failed, the first with: {failed[0].failure}" if failed else "none"
        raise InputError("table", "metrics", expected="metrics of some variant", found=found)
    rows = _without_identical_views({path: read_metrics(path) for path in metrics})
    _require_distinct(metrics)
    _require_reference_kinds(rows)
    _require_equal_views(rows)
    variants = {path.parents[path.parent.name == DETECTIONS].resolve() for path in (*metrics, *detections)}
    for variant in sorted(variants):
        require_origins(variant, (*metrics, *detections, *retrievals))
    require_equal_images((*metrics, *detections), retrievals)
    require_same_renders([path for path in metrics if {SCENE, "."} & {row.target for row in rows[path]}], detections)
    require_equal_references(metrics)
    require_equal_renders(metrics)
    require_one_owner((*metrics, *detections))
    require_one_origin(sorted(variants), attacks, conditions)
    outcomes = [*(_outcome(path, rows[path], prune_masks, truth, verdicts) for path in metrics), *failed]
    outcomes = _with_detections(outcomes, detections, failures)
    retrieved = {path.parent.resolve().parts[-2:]: read_table(path, Retrieved) for path in retrievals}
    for scheme, folder in retrieved.keys() - {(o.scheme, o.folder) for o in outcomes} if not failures else ():
        raise InputError("table", "--retrievals", expected="models with metrics", found=f"{scheme}/{folder}")
    if len(retrieved) < len(retrievals):
        found = f"{len(retrievals)} files of {len(retrieved)} models"
        raise InputError("table", "retrievals", expected="one file for every model", found=found)
    outcomes = [replace(o, retrieval=_retrieval(o, retrieved.get((o.scheme, o.folder), ()))) for o in outcomes]
    _require_all_retrieved(outcomes, may_lack_models=bool(failures))
    for model in conditions.keys() - {f"{o.scheme}/{o.folder}" for o in outcomes} if not failures else ():
        raise InputError("table", "--condition", expected="a model with metrics", found=model)
    trained = [conditions.get(f"{o.scheme}/{o.folder}", ("", "")) for o in outcomes]
    outcomes = [replace(o, protocol=p, initialization=i) for o, (p, i) in zip(outcomes, trained, strict=True)]
    outcomes.sort(key=lambda outcome: (outcome.scheme, outcome.scene, outcome.seed, outcome.variant != UNATTACKED))
    return with_references(outcomes)


def with_references(outcomes: Iterable[Outcome]) -> list[Outcome]:
    """Return outcomes, sorted by model, with the metrics of their unattacked model as reference."""
    complete: list[Outcome] = []
    for _, variants in by_model(outcomes):
        unattacked = next((o for o in variants if o.variant == UNATTACKED), None)
        if unattacked:
            before, off_path_before, marks_before = unattacked.targets, unattacked.off_path, unattacked.detections
            complete += [
                replace(o, reference=before, off_path_reference=off_path_before, detections_before=marks_before)
                for o in variants
            ]
        else:
            complete += variants
    return complete


def by_model(outcomes: Iterable[Outcome]) -> list[tuple[tuple[str, str], list[Outcome]]]:
    """Return scheme and folder of each model with its outcomes; both keep their order."""
    return [*grouped(outcomes, lambda o: (o.scheme, o.folder)).items()]


def by_condition(outcomes: Iterable[Outcome]) -> dict[Condition, list[Outcome]]:
    """Return the outcomes of every condition; both keep their order."""
    return grouped(outcomes, lambda o: o.condition)


def _failed(statuses: Sequence[Path]) -> list[Outcome]:
    """Return the variants without metrics."""
    missing = _missing(statuses).items()
    return [replace(_empty(path), failure=reason) for path, reason in missing if path.name == "metrics.csv"]


def _missing(statuses: Sequence[Path]) -> dict[Path, str]:
    """Return the results that are missing because of a failed job, each with the first reason."""
    reasons: dict[Path, str] = {}
    for failure in map(read_failure, statuses):
        for path in map(Path, failure.missing):
            reasons.setdefault(path, failure.reason)
    return reasons


def _with_detections(outcomes: Sequence[Outcome], tables: Sequence[Path], failures: Sequence[Path]) -> list[Outcome]:
    """Return outcomes with the readings of detectors, and one for each control that has nothing else."""
    by_variant = read_detections(tables)
    reasons: dict[tuple[str, str, str], dict[str, str]] = {}
    for path, reason in _missing(failures).items():
        if path.parent.name == DETECTIONS:
            reasons.setdefault(variant_of(path), {})[path.stem] = reason
    known = {(o.scheme, o.folder, o.variant): o for o in outcomes}
    for key in (*by_variant, *reasons):
        o = known.get(key) or _empty(Path(*key, "metrics.csv"))
        known[key] = replace(o, detections=by_variant.get(key, {}), undetected=reasons.get(key, {}))
    return [*known.values()]


def _empty(path: Path) -> Outcome:
    """Return the outcome of a file of metrics, without any number."""
    scheme, folder, variant = path.parent.resolve().parts[-3:]
    scene, _, seed = folder.partition("@")
    return Outcome(scheme, scene, variant, {}, {}, seed=int(seed) if seed.isdecimal() else 0)


def _require_distinct(metrics: Sequence[Path]) -> None:
    """Raise `InputError` if two files are of one variant of one model: differences could be between two runs."""
    known: dict[tuple[str, str, int, str], Path] = {}
    for path, o in zip(metrics, map(_empty, metrics), strict=True):
        first = known.setdefault((o.scheme, o.scene, o.seed, o.variant), path)
        if first is not path:
            expected = "one file for every variant of a model"
            raise InputError(path, o.variant, expected=expected, found=f"a second one beside {first}")


def _require_reference_kinds(rows_of: Mapping[Path, Sequence[ViewMetrics]]) -> None:
    """Raise `InputError` if a variant is compared with renders and the unattacked model with photographs."""
    references_of = {place(path): {row.target: row.reference for row in rows} for path, rows in rows_of.items()}
    for path, references in references_of.items():
        before = references_of.get(path.parent.parent / UNATTACKED / path.name, {})
        for target, reference in references.items():
            if (expected := before.get(target, reference)) != reference:
                raise InputError(path, target, expected=f"reference {expected}, as {UNATTACKED} has", found=reference)


def _without_identical_views(rows_of: Mapping[Path, list[ViewMetrics]]) -> dict[Path, list[ViewMetrics]]:
    """Leave out the views that equal their photograph in some variant of a model: no mean PSNR counts them there.

    A drop is a difference of means over the same views. Where none is left, variants with such views keep them alone,
    so that their mean PSNR is infinite, and no drop from it or to it is known.
    """
    identical_in: dict[tuple[Path, str], set[str]] = {}
    for path, rows in rows_of.items():
        for row in filter(_equals_photograph, rows):
            identical_in.setdefault((path.parent.resolve().parent, row.target), set()).add(row.view)
    kept: dict[Path, list[ViewMetrics]] = {}
    for path, rows in rows_of.items():
        model, kept[path] = path.parent.resolve().parent, []
        for target, part in product(dict.fromkeys(row.target for row in rows), (on_path, off_path)):
            views = [row for row in part(rows) if row.target == target]
            others = [row for row in views if row.view not in identical_in.get((model, target), ())]
            kept[path] += others or [*filter(_equals_photograph, views)] or views
    return kept


def _require_equal_views(rows_of: Mapping[Path, Sequence[ViewMetrics]]) -> None:
    """Raise `InputError` if two means would be over different views: their difference would not be a drop.

    Targets must be equal, too; those of controls are some of the model's.
    """
    views_of = {place(path): _views_in_means(rows) for path, rows in rows_of.items()}
    for path, views in views_of.items():
        before = views_of.get(path.parent.parent / UNATTACKED / path.name, views)
        if (views.keys() ^ before.keys()) - (before.keys() if path.parent.name in CONTROLS else set()):
            expected = f"those of {UNATTACKED}: {', '.join(sorted(before))}"
            raise InputError(path, "targets", expected=expected, found=", ".join(sorted(views)))
        for target in views.keys() & before.keys():
            different = views[target] ^ before[target]
            if different and views[target] and before[target]:
                expected = f"the views of {UNATTACKED}, {len(before[target])} in the mean PSNR"
                names = ", ".join(sorted(different)[:3])
                raise InputError(path, target, expected=expected, found=f"{len(views[target])}; not in both: {names}")


def _views_in_means(rows: Sequence[ViewMetrics]) -> dict[str, set[str]]:
    """Return the views of each mean, without those equal to their photograph, which no mean PSNR counts."""
    views: dict[str, set[str]] = {}
    for row in rows:
        mean = f"{row.target} off path" if off_path([row]) else row.target
        views.setdefault(mean, set()).update([] if _equals_photograph(row) else [row.view])
    return views


def _equals_photograph(row: ViewMetrics) -> bool:
    return row.reference == TRUTH and not math.isfinite(row.psnr)


def _outcome(
    path: Path,
    rows: Sequence[ViewMetrics],
    prune_masks: Sequence[Path],
    truth: Sequence[Path],
    verdicts: Sequence[Path],
) -> Outcome:
    folder = path.parent.resolve()
    outcome = _empty(path)
    targets = {mean.target: mean for mean in means(on_path(rows))}
    views = {target: sum(row.target == target for row in on_path(rows)) for target in targets}
    same = {target: identical(on_path(rows))[target] for target in targets}
    off = {mean.target: mean for mean in means(off_path(rows))}
    outcome = replace(outcome, targets=targets, views=views, identical=same, off_path=off)
    outcome = replace(outcome, **_verdict(_below(folder, verdicts)))
    if (mask_file := _below(folder, prune_masks)) is None:
        return outcome
    pruned = load_array(mask_file, dtype=np.bool_, shape=(None,))
    outcome = replace(outcome, pruned_share=float(np.mean(pruned)))
    if (truth_file := _below(folder.parent, truth)) is None:
        return outcome
    require_embedding(embedding_of(mask_file), truth_file)
    agreement = recall(pruned, load_array(truth_file, dtype=np.bool_, shape=(len(pruned),)))
    return replace(outcome, precision=agreement.precision, recall=agreement.recall)


def _retrieval(o: Outcome, retrieved: Sequence[Retrieved]) -> dict[str, Retrieval]:
    return {row.target: row.retrieval for row in retrieved if row.variant == o.variant}


def _require_all_retrieved(outcomes: Sequence[Outcome], *, may_lack_models: bool) -> None:
    """Refuse an extraction without retrieval if another variant has one of it: it would count as not retrieved.

    That of a baseline is never retrieved. With `may_lack_models`, as after a failure, whole models may lack it.
    """

    def beside(o: Outcome, extraction: str) -> tuple[str, str, str]:
        return (o.scheme, o.folder if may_lack_models else "", extraction)

    retrieved = {beside(o, extraction) for o in outcomes for extraction in o.retrieval}
    for o in (o for o in outcomes if o.variant not in BASELINES):
        for extraction in filter(is_picture, o.targets):
            if extraction not in o.retrieval and beside(o, extraction) in retrieved:
                table, expected = f"retrieval.csv of {o.scheme}/{o.folder}", f"{extraction} of {o.variant}"
                hint = "run `gspure retrieve` for all variants"
                raise InputError(table, "rows", expected=expected, found="none", hint=hint)


def _verdict(verdict: Path | None) -> dict[str, Any]:
    """Return which extractions an attack can have affected, and its strength."""
    if verdict is None:
        return {}
    match read_json(verdict):
        case {"reached": dict(reached), "strength": str(strength)} if {*map(type, reached.values())} <= {bool}:
            return {"reached": reached, "strength": strength}
    raise InputError(verdict, "file", expected="the verdict of an attack", found="other JSON")


def _below(folder: Path, files: Iterable[Path]) -> Path | None:
    """Return the file below a folder, or None; raise `InputError` if there are several."""
    below = {path: file for file in files if (path := place(file)).is_relative_to(folder)}
    first, *others = below.values() or [None]
    if others:
        raise InputError(str(others[0]), "file", expected="one for every folder", found=f"a second one beside {first}")
    return first


def _difference(a: float, b: float) -> float:
    return difference(a, b) if math.isfinite(a) and math.isfinite(b) else math.nan
