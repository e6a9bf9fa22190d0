"""The outcome of a variant: what its files say about the scene, the message, and the attack."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from gspure.evaluation.attack_record import StrengthValue
from gspure.evaluation.evidence import Evidence, SceneChange
from gspure.evaluation.identity import Condition, ModelId
from gspure.grouping import grouped
from gspure.metrics.bit_evidence import BitEvidence
from gspure.metrics.comparison import ViewMetrics
from gspure.metrics.detection import Detection
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE
from gspure.metrics.names import UNATTACKED, is_control, variant_title
from gspure.metrics.statistics import Interval, difference, known_interval, scene_means
from gspure.metrics.targets import HIDDEN_BITS, MESSAGE, SCENE, is_picture, needs_rows
from gspure.text import decimal

UNCHANGED: Final = 0.05  # largest change of an extraction, dB or points, due to rounding, as of reordered rows


@dataclass(frozen=True)
class Outcome:
    """One variant or control of one model: its mean metrics by target, and the evidence of the message.

    Unknown numbers are NaN; so are drops from an infinite PSNR, as of a model compared with its own renders.
    """

    scheme: str
    scene: str
    variant: str
    targets: Mapping[str, ViewMetrics] = field(default_factory=dict)
    views: Mapping[str, int] = field(default_factory=dict)
    pruned_share: float = math.nan
    entry: str = ""  # the variant's entry in the configuration, which several damages share; empty for `variant`
    wanted: float = math.nan  # drop of the scene's PSNR for which the strength was searched, dB
    strength: StrengthValue | None = None  # of the attack, if it has one
    search_damage: float = math.nan  # drop at which the search for the strength ended, dB
    affects: Mapping[str, bool] = field(default_factory=dict)  # by extraction: whether the attack changed what it reads
    failure: str = ""  # why there are no metrics; empty if there are
    identical: Mapping[str, int] = field(default_factory=dict)  # views of infinite PSNR, in no mean unless all are
    change: SceneChange | None = None  # what the attack did to the scene
    evidence: Mapping[str, Evidence] = field(default_factory=dict)  # by extraction of the message
    detections: Mapping[str, Detection] = field(default_factory=dict)  # by detector, of renders of the scene
    bits: Mapping[str, BitEvidence] = field(default_factory=dict)  # by detector of bits
    detector_errors: Mapping[str, str] = field(default_factory=dict)  # by detector without readings: the reason
    unreadable: Mapping[str, str] = field(default_factory=dict)  # by extraction: why it cannot read the attacked model
    seed: int = 0  # number of the repetition on the same scene, each with its own random seeds
    protocol: str = ""
    initialization: str = ""  # like `protocol`, see `Condition`
    run: str = ""  # run ID of its model
    before: "Outcome | None" = None  # that of the model before the attack, without its own

    @property
    def condition(self) -> Condition:
        """Its scheme, protocol and initialization."""
        return Condition(self.scheme, self.protocol, self.initialization)

    @property
    def model(self) -> ModelId:
        """The model that it is an outcome of."""
        return ModelId(self.scheme, self.scene, self.seed)

    @property
    def title(self) -> str:
        """The display name of the variant."""
        return variant_title(self.entry or self.variant, self.wanted)

    @property
    def damage(self) -> float:
        """The damage to the scene, dB; NaN without photographs, and for a control."""
        return math.nan if self.change is None or self.change.damage is None else self.change.damage

    @property
    def fidelity(self) -> float:
        """The PSNR of the scene's renders against those of the unattacked model, dB, where there is no damage."""
        if self.change is None or self.change.damage is not None or self.variant == UNATTACKED:
            return math.nan
        return math.inf if self.change.fidelity is None else self.change.fidelity

    @property
    def coverage_lost(self) -> float:
        """The share of the pixels that the attack uncovers."""
        return self.change.coverage_lost if self.change else math.nan

    @property
    def strength_text(self) -> str:
        """The strength, and the damage at which the search for it ended if that is not the wanted one."""
        if self.strength is None:
            return ""
        misses = abs(self.search_damage - self.wanted) > DAMAGE_TOLERANCE
        return f"{self.strength}, {self.search_damage:z.2f} dB reached" if misses else str(self.strength)

    def level(self, target: str, metric: str = "psnr") -> float:
        """Return the target's PSNR, dB, or another metric, or the mean reading of a detector; NaN if it is unknown."""
        if target in self.detections:
            return self.detections[target].level
        return self.targets[target].values.get(metric, math.nan) if target in self.targets else math.nan

    def psnr_drop(self, target: str) -> float:
        r"""Return :math:`\Delta PSNR`, the drop of the target's PSNR relative to the unattacked model, in dB."""
        if self.before is None:
            return math.nan
        first = self.before.level(target)
        last = self.level(target)
        return difference(first, last) if math.isfinite(first + last) else math.nan

    def reaches(self, extraction: str) -> bool | None:
        """Return whether the attack affected an extraction: the columns that it reads, or its result; None if unknown.

        A result that changed shows that the declared columns are incomplete (`contradicts`).
        """
        return self.contradicts(extraction) or self.affects.get(extraction)

    def contradicts(self, extraction: str) -> bool:
        """Return whether the extraction changed, although no column did that it is declared to read."""
        before = self.before.level(extraction) if self.before else math.nan
        return self.affects.get(extraction) is False and abs(before - self.level(extraction)) > UNCHANGED

    @property
    def is_control(self) -> bool:
        """Whether it is a negative control (`gspure.metrics.names`)."""
        return is_control(self.variant)

    @property
    def messages(self) -> list[str]:
        """The targets that are extractions of the message, the scheme's own first, and its detectors."""
        return ordered([*filter(needs_rows, {**self.targets, **self.unreadable}), *self.detections])

    @property
    def failures(self) -> dict[str, str]:
        """Why there are no metrics, or no readings of a detector, by what is missing."""
        failures = {self.title: self.failure} if self.failure else {}
        return failures | {f"{name} of {self.title}": reason for name, reason in self.detector_errors.items()}


def ordered(targets: Iterable[str]) -> list[str]:
    """Return targets in display order: the scene, the message, its other extractions, hidden bits, detectors."""

    def rank(name: str) -> tuple[bool, bool, bool, bool, str]:
        return name != SCENE, name != MESSAGE, not is_picture(name), name not in HIDDEN_BITS, name

    return sorted(targets, key=rank)


def extractions(outcomes: Iterable[Outcome]) -> list[str]:
    """Return the extractions and detectors of any of the outcomes, in display order."""
    return ordered({target for o in outcomes for target in o.messages})


def with_references(outcomes: Iterable[Outcome]) -> list[Outcome]:
    """Return outcomes, sorted by model, with that of their unattacked model."""
    complete: list[Outcome] = []
    for variants in by_model(outcomes).values():
        before = {o.variant: o for o in variants}.get(UNATTACKED)
        complete += [replace(o, before=before) for o in variants]
    return complete


def by_model(outcomes: Iterable[Outcome]) -> dict[ModelId, list[Outcome]]:
    """Return the outcomes of every model; both keep their order."""
    return grouped(outcomes, lambda o: o.model)


def by_condition(outcomes: Iterable[Outcome]) -> dict[Condition, list[Outcome]]:
    """Return the outcomes of every condition; both keep their order."""
    return grouped(outcomes, lambda o: o.condition)


def cells(outcomes: Iterable[Outcome], value: Callable[[Outcome], float]) -> dict[tuple[str, int], float]:
    """Return a number of the outcomes by scene and seed, where it is known."""
    return {(o.scene, o.seed): known for o in outcomes if not math.isnan(known := value(o))}


def mean_of(outcomes: Iterable[Outcome], value: Callable[[Outcome], float]) -> Interval | None:
    """Return the mean over scenes where it is finite, with its interval; None if it is so nowhere."""
    return known_interval(cells(outcomes, value))


def title_with_damage(title: str, wanted: float, *scene_drops: float) -> str:
    """Return the title of a variant, with the range of its drops, in dB, where any misses the wanted damage."""
    known = sorted(filter(math.isfinite, scene_drops))
    if not any(abs(drop - wanted) > DAMAGE_TOLERANCE for drop in known):  # False without a wanted damage
        return title
    bounds = dict.fromkeys([decimal(known[0]), decimal(known[-1])])
    return f"{title} ({' to '.join(bounds)} dB reached)"


def titles_with_damage(outcomes: Iterable[Outcome]) -> dict[str, str]:
    """Return the `title_with_damage` of every variant, from the mean over seeds in each of its scenes."""
    titles = {}
    for variant, alike in grouped(outcomes, lambda o: o.variant).items():
        means = scene_means(cells(alike, lambda o: o.damage))
        titles[variant] = title_with_damage(alike[0].title, alike[0].wanted, *means.values())
    return titles
