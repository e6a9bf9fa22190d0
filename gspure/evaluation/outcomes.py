"""The outcome of a variant: metrics of scene and message, and precision and recall of its pruning."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Final, NamedTuple

from gspure.grouping import grouped
from gspure.metrics.comparison import ViewMetrics
from gspure.metrics.csv_tables import UNPREFIXED
from gspure.metrics.detection import Detection
from gspure.metrics.image_metrics import METRICS
from gspure.metrics.names import CLEAN, CLEAN_GSPURE, CONTROLS, UNATTACKED, display_name
from gspure.metrics.retrieval import Retrieval
from gspure.metrics.statistics import Interval, difference, known_interval
from gspure.metrics.targets import BITS, MESSAGE, SCENE, is_picture

UNCHANGED: Final = 0.05  # largest change of an extraction, dB or points, due to rounding, as of reordered rows


class Condition(NamedTuple):
    """What outcomes have in common that are averaged over scenes, and compared with each other."""

    scheme: str
    protocol: str = ""  # poses of the message's views, `shared` or `own`; empty for models of no pair
    initialization: str = ""  # whose points training starts from, `both` or `scene`; empty for models of no pair

    @property
    def key(self) -> str:
        """Its name in folders: ``gs_hider-own-both``."""
        return "-".join(filter(None, self))

    @property
    def title(self) -> str:
        """Its display name: ``GS-Hider, own poses``; training from all points is the default."""
        poses = f", {self.protocol} poses" if self.protocol else ""
        return display_name(self.scheme) + poses + ", scene's points" * (self.initialization == "scene")


OfCondition = Annotated[Condition, UNPREFIXED]  # the first columns of a row


@dataclass(frozen=True)
class Outcome:
    """One variant of one model: its mean metrics by target, and the quality of its pruning.

    Unknown numbers are NaN; so are drops from an infinite PSNR, as of a model compared with its own renders.
    """

    scheme: str
    scene: str
    variant: str
    targets: Mapping[str, ViewMetrics] = field(default_factory=dict)
    views: Mapping[str, int] = field(default_factory=dict)
    pruned_share: float = math.nan
    precision: float = math.nan
    recall: float = math.nan
    reached: Mapping[str, bool] = field(default_factory=dict)  # by extraction: whether the attack changed what it reads
    strength: str = ""  # the attack's strength, `fraction=0.25`; empty if it has none
    failure: str = ""  # why there are no metrics; empty if there are
    identical: Mapping[str, int] = field(default_factory=dict)  # views of infinite PSNR, in no mean unless all are
    retrieval: Mapping[str, Retrieval] = field(default_factory=dict)  # by extraction of the message
    detections: Mapping[str, Detection] = field(default_factory=dict)  # by detector, of renders of the scene
    nominal: Mapping[str, float] = field(default_factory=dict)  # of targets without photographs: `nominal_drop`, dB
    undetected: Mapping[str, str] = field(default_factory=dict)  # for each detector without readings, why; and for each
    # extraction that cannot read the attacked model at all, since the attack has left its format: the message is gone
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
        if self.before and target in self.detections.keys() & self.before.detections.keys():
            return difference(self.before.level(target), self.level(target))
        return self.psnr_drop(target)

    def drops(self, target: str) -> dict[str, float]:
        """Return the drop of each metric from the unattacked model; without photographs, the nominal one of PSNR."""
        before = self.before
        if not before or target not in self.targets.keys() & before.targets.keys():
            return dict.fromkeys(METRICS, math.nan)
        levels = {name: (before.targets[target].values[name], self.targets[target].values[name]) for name in METRICS}
        drops = {name: difference(a, b) if math.isfinite(a + b) else math.nan for name, (a, b) in levels.items()}
        if target in self.nominal.keys() & before.nominal.keys():
            drops["psnr"] = self.nominal[target] - before.nominal[target]
        return drops

    def psnr_drop(self, target: str) -> float:
        r"""Return :math:`\Delta PSNR`, the drop of the target's PSNR relative to the unattacked model, in dB."""
        return self.drops(target)["psnr"]

    def reaches(self, extraction: str) -> bool | None:
        """Return whether the attack affected an extraction: the columns that it reads, or its result; None if unknown.

        A result that changed shows that the declared columns are incomplete (`contradicts`).
        """
        return self.contradicts(extraction) or self.reached.get(extraction)

    def contradicts(self, extraction: str) -> bool:
        """Return whether the extraction changed, although no column did that it is declared to read."""
        before = self.before.level(extraction) if self.before else math.nan
        return self.reached.get(extraction) is False and abs(before - self.level(extraction)) > UNCHANGED

    @property
    def is_control(self) -> bool:
        """Whether it is a negative control (`gspure.metrics.names`)."""
        return self.variant in CONTROLS

    def is_flat(self, target: str) -> bool:
        """Return whether its images of the target are of one colour each: they correlate with no photograph."""
        return target in self.targets and self.targets[target].values["structure"] == 0

    @property
    def messages(self) -> list[str]:
        """The targets that are extractions of the message, the scheme's own first, and its detectors."""
        return ordered([*filter(is_picture, {**self.targets, **self.undetected}), *self.detections])

    def score_of(self, target: str) -> float:
        r"""Return the paper's measure of an attack, in dB; NaN for a control.

        .. math:: Score = \Delta PSNR_{message} - \Delta PSNR_{scene}

        (paper, §Metrics.) `target` is an extraction of the message.
        """
        return math.nan if self.is_control else self.psnr_drop(target) - self.psnr_drop(SCENE)

    @property
    def score(self) -> float:
        """The Score of the extraction ``message``."""
        return self.score_of(MESSAGE)

    @property
    def failures(self) -> dict[str, str]:
        """Why there are no metrics, or no readings of a detector, by what is missing."""
        name = display_name(self.variant)
        failed = {name: self.failure} if self.failure else {}
        return failed | {f"{of} of {name}": reason for of, reason in self.undetected.items() if not is_picture(of)}


def ordered(targets: Iterable[str]) -> list[str]:
    """Return targets in display order: the scene, the message, its other extractions, hidden bits, detectors."""
    return sorted(targets, key=lambda name: (name != SCENE, name != MESSAGE, not is_picture(name), name != BITS, name))


def extractions(outcomes: Iterable[Outcome]) -> list[str]:
    """Return the extractions and detectors of any of the outcomes, in display order."""
    return ordered({target for o in outcomes for target in o.messages})


def with_references(outcomes: Iterable[Outcome]) -> list[Outcome]:
    """Return outcomes, sorted by model, with that of their unattacked model; of a clean model, with the clean one's."""
    complete: list[Outcome] = []
    for _, variants in by_model(outcomes):
        before = {o.variant: o for o in variants}
        complete += [
            replace(o, before=before.get(CLEAN if o.variant == CLEAN_GSPURE else UNATTACKED)) for o in variants
        ]
    return complete


def by_model(outcomes: Iterable[Outcome]) -> list[tuple[tuple[str, str], list[Outcome]]]:
    """Return scheme and folder of each model with its outcomes; both keep their order."""
    return [*grouped(outcomes, lambda o: (o.scheme, o.folder)).items()]


def by_condition(outcomes: Iterable[Outcome]) -> dict[Condition, list[Outcome]]:
    """Return the outcomes of every condition; both keep their order."""
    return grouped(outcomes, lambda o: o.condition)


def cells(outcomes: Iterable[Outcome], value: Callable[[Outcome], float]) -> dict[tuple[str, int], float]:
    """Return a number of the outcomes by scene and seed, where it is known."""
    return {(o.scene, o.seed): known for o in outcomes if not math.isnan(known := value(o))}


def mean_of(outcomes: Iterable[Outcome], value: Callable[[Outcome], float]) -> Interval | None:
    """Return the mean over scenes where it is finite, with its interval; None if it is so nowhere."""
    return known_interval(cells(outcomes, value))
