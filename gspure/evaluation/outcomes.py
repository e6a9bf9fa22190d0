"""What an attack took from the scene, what from the message, and whether it found the right Gaussians."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import Final

import numpy as np

from gspure.artifacts import load_array, read_json
from gspure.errors import InputError
from gspure.evaluation.comparison import TRUTH, ViewMetrics, means, off_path, on_path, read_metrics
from gspure.evaluation.controls import CONTROLS
from gspure.evaluation.recall import recall
from gspure.failures import note_of

REFERENCE: Final = "watermarked"
"""The variant that drops are relative to."""

SCENE, MESSAGE = "scene", "message"


@dataclass(frozen=True)
class Outcome:
    """One variant of one model: its mean metrics by target, and what is known of its pruning.

    Numbers that are not known are NaN. Where images are compared with renders of the unattacked model, that model's own
    PSNR is infinite, and how far others fall below it is not known.
    """

    scheme: str
    scene: str
    variant: str
    targets: Mapping[str, ViewMetrics]
    views: Mapping[str, int]
    pruned_share: float = math.nan
    precision: float = math.nan
    recall: float = math.nan
    reference: Mapping[str, ViewMetrics] = field(default_factory=dict)
    """The same means of the variant `REFERENCE`."""

    reached: Mapping[str, bool] = field(default_factory=dict)
    """For each extraction of the message, whether the attack touched what it reads; empty where that is not known."""

    failure: str = ""
    """Why there are no metrics: what went wrong on the way to them."""

    off_path: Mapping[str, ViewMetrics] = field(default_factory=dict)
    """The same means as `targets`, of views beside the path of the cameras; empty where there are none."""

    off_path_reference: Mapping[str, ViewMetrics] = field(default_factory=dict)
    """Those of the variant `REFERENCE`."""

    seed: int = 0
    """Which repetition on the same scene, with other seeds, this is."""

    @property
    def asset(self) -> str:
        """Its model among those of its scheme, as its folder is named: ``room``, or ``room@1`` for a repetition."""
        return f"{self.scene}@{self.seed}" if self.seed else self.scene

    def psnr_drop(self, target: str) -> float:
        r"""Return :math:`\Delta PSNR`: how far the target's PSNR lies below that of the watermarked variant, in dB."""
        if target not in self.targets or target not in self.reference:
            return math.nan
        return _difference(self.reference[target].psnr, self.targets[target].psnr)

    def ssim_drop(self, target: str) -> float:
        """Return how far the target's SSIM lies below that of the watermarked variant."""
        if target not in self.targets or target not in self.reference:
            return math.nan
        return self.reference[target].ssim - self.targets[target].ssim

    @property
    def against_truth(self) -> bool:
        """Whether its metrics compare with photographs of the truth, not with renders of the unattacked model."""
        return all(mean.reference == TRUTH for mean in self.targets.values())

    @property
    def is_control(self) -> bool:
        """Whether it is a negative control: what is to be seen where no message is, or none that the key opens."""
        return self.variant in CONTROLS

    @property
    def messages(self) -> list[str]:
        """The targets that are extractions of the message, the scheme's own first."""
        return ordered(target for target in self.targets if target.startswith(MESSAGE))

    def score_of(self, target: str) -> float:
        r"""Return the paper's measure of an attack, in dB; a control is no attack.

        .. math:: Score = \Delta PSNR_{message} - \Delta PSNR_{scene}

        (paper, §Metrics.) `target` is the extraction that shows the message.
        """
        return math.nan if self.is_control else self.psnr_drop(target) - self.psnr_drop(SCENE)

    def aside(self) -> Outcome:
        """Return this variant as views beside the path show it."""
        return replace(self, targets=self.off_path, reference=self.off_path_reference)

    @property
    def score(self) -> float:
        """The Score, of the message as the scheme extracts it."""
        return self.score_of(MESSAGE)


def ordered(targets: Iterable[str]) -> list[str]:
    """Return targets in the order of telling: the scene, the message, its other extractions."""
    return sorted(targets, key=lambda target: (target != SCENE, target != MESSAGE, target))


def collect(
    metrics: Sequence[Path],
    kept: Sequence[Path] = (),
    truth: Sequence[Path] = (),
    verdicts: Sequence[Path] = (),
) -> list[Outcome]:
    """Gather the outcomes of all variants.

    Parameters
    ----------
    metrics : sequence of Path
        Files ``.../{scheme}/{scene}/{variant}/metrics.csv``: the folders say whose they are. Scenes that end in ``@1``,
        ``@2``, ... are repetitions with other seeds. Where a file could not be made, its note tells why.
    kept : sequence of Path
        Masks ``.npy`` bool [K], true where a variant kept the row, anywhere below the variant's folder.
    truth : sequence of Path
        Masks ``.npy`` bool [K], true where a row belongs to the message, anywhere below ``{scheme}/{scene}``.
    verdicts : sequence of Path
        Files ``verdict.json`` of `gspure attack`, anywhere below the variant's folder.

    Returns
    -------
    list of Outcome
        Sorted by scheme and scene, in each the variant `REFERENCE` first, then in the order given.

    Raises
    ------
    InputError
        If a file cannot be read, two masks of one model have different lengths, or everything has failed.

    """
    found = [_outcome(path, kept, truth, verdicts) for path in metrics]
    if found and all(outcome.failure for outcome in found):
        raise InputError(metrics[0], "metrics", expected="metrics of some variant", found=found[0].failure)
    found.sort(key=lambda outcome: (outcome.scheme, outcome.scene, outcome.seed, outcome.variant != REFERENCE))
    outcomes = []
    for _, group in groupby(found, key=lambda outcome: (outcome.scheme, outcome.asset)):
        outcomes += referred(list(group))
    return outcomes


def referred(variants: Sequence[Outcome]) -> list[Outcome]:
    """Return the variants of one model with what they are to be compared with: that of `REFERENCE`."""
    first = next((o for o in variants if o.variant == REFERENCE), None)
    if first is None:
        return list(variants)
    return [replace(o, reference=first.targets, off_path_reference=first.off_path) for o in variants]


def _outcome(path: Path, kept: Sequence[Path], truth: Sequence[Path], verdicts: Sequence[Path]) -> Outcome:
    folder = path.resolve().parent
    scheme, asset, variant = folder.parts[-3:]
    scene, _, seed = asset.partition("@")
    outcome = Outcome(scheme, scene, variant, {}, {}, seed=int(seed) if seed.isdecimal() else 0)
    if failure := note_of(path).reason:
        return replace(outcome, failure=failure)
    rows = read_metrics(path)
    targets = {mean.target: mean for mean in means(on_path(rows))}
    views = {target: sum(row.target == target for row in on_path(rows)) for target in targets}
    aside = {mean.target: mean for mean in means(off_path(rows))}
    outcome = replace(outcome, targets=targets, views=views, off_path=aside, reached=_reached(_below(folder, verdicts)))
    if (kept_file := _below(folder, kept)) is None:
        return outcome
    pruned = ~load_array(kept_file, dtype=np.bool_, shape=(None,))
    outcome = replace(outcome, pruned_share=float(np.mean(pruned)))
    if (truth_file := _below(folder.parent, truth)) is None:
        return outcome
    found = recall(pruned, load_array(truth_file, dtype=np.bool_, shape=(len(pruned),)))
    return replace(outcome, precision=found.precision, recall=found.recall)


def _reached(verdict: Path | None) -> dict[str, bool]:
    """Return what an attack reached."""
    if verdict is None:
        return {}
    match read_json(verdict):
        case {"reached": dict(reached)} if all(isinstance(v, bool) for v in reached.values()):
            return reached
    raise InputError(verdict, "file", expected="the verdict of an attack", found="other JSON")


def _below(folder: Path, files: Iterable[Path]) -> Path | None:
    return next((file for file in files if file.resolve().is_relative_to(folder)), None)


def _difference(a: float, b: float) -> float:
    if a == b:
        return 0.0
    return a - b if math.isfinite(a) and math.isfinite(b) else math.nan
