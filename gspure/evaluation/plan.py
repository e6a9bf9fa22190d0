"""The plan of a run: its models and, for each of them, the jobs that evaluate variants and controls.

`gspure.workflow.planning` makes it from a configuration; the rules, the jobs and the report read it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final, Literal

from gspure.codec import read
from gspure.evaluation.identity import RESULTS, Condition, ModelId
from gspure.files import read_json
from gspure.method.settings import MethodSettings
from gspure.metrics.names import WRONG_KEY
from gspure.metrics.targets import MESSAGE, SCENE
from gspure.settings import Setting

Split = Literal["train", "test", "all"]
Until = Literal["gone", "unreadable"]

PLAN_FILE: Final = "plan.json"  # file in the folder of results
CONFIGURATION: Final = "configuration.json"  # for people
METHOD: Final = "method"  # the decision with the settings of `method` in the configuration


@dataclass(frozen=True)
class Detector:
    """A command that reads a mark: its embedded bits, or none of a score, seconds to wait, and what it reads."""

    command: str
    message: str = ""
    timeout: float = 600.0
    reads: Literal["renders", "model"] = "renders"


@dataclass(frozen=True)
class AttackSpec:
    """An attack with its settings; its strength is searched for a `damage`, dB, or `until` the message is gone.

    `entry` is the entry of the configuration, which variants of several damages share.
    """

    name: str
    entry: str = ""
    settings: Mapping[str, Setting] = field(default_factory=dict)
    seed: int = 0
    damage: float | None = None
    until: Until | None = None
    measured: Mapping[str, Path] = field(default_factory=dict)  # files of `gspure.attacks.Measurements` by name


@dataclass(frozen=True)
class Control:
    """A negative control."""

    name: str

    @property
    def has_wrong_key(self) -> bool:
        """Whether the message is extracted with an unrelated key."""
        return self.name == WRONG_KEY


@dataclass(frozen=True)
class Views:
    """The views of a model, and what its renders are compared with."""

    cameras: Path
    split: Split
    unattacked: Path  # folder of renders of the unattacked model: the reference without photographs
    photographed: tuple[str, ...] = ()  # of `SCENE` and `MESSAGE`, what is compared with photographs


@dataclass(frozen=True)
class Owner:
    """What only the owner of a message has.

    The adaptive extraction matches rows with the `published_model`, and learns from `photographs` of the message. Where
    these are None, it is not evaluated, or does not learn. `candidates` are pictures of the message's kind
    (`gspure.scenes.candidates`), and `twins` the number of models whose carriers are drawn again.
    """

    scheme: str
    key: Path
    message_cameras: Path
    bit_targets: tuple[str, ...] = ()  # of `HIDDEN_BITS`, what the key reads; empty if the message is a picture
    reveals: bool = False  # whether the key tells which rows show the message
    published_model: Path | None = None
    photographs: Path | None = None
    candidates: Path | None = None
    twins: int = 0


@dataclass(frozen=True)
class Job:
    """The evaluation of one variant or control of a model."""

    model: ModelId
    variant: str
    public: Path  # the model to attack or, of a control, to show
    case: AttackSpec | Control
    views: Views
    owner: Owner | None = None
    rendered: tuple[str, ...] = (SCENE,)
    compared: tuple[str, ...] = (SCENE,)
    detectors: Mapping[str, Detector] = field(default_factory=dict)
    bit_targets: tuple[str, ...] = ()  # of `HIDDEN_BITS`, what the key reads in this job
    inputs: tuple[Path, ...] = ()  # files that other jobs make
    users_files: tuple[Path, ...] = ()
    modules: tuple[str, ...] = ()  # whose code its results depend on, beside that of the evaluation

    @property
    def folder(self) -> Path:
        """The folder of its results."""
        return self.model.folder / self.variant

    @property
    def control(self) -> Control | None:
        """Its control; None for a variant."""
        return self.case if isinstance(self.case, Control) else None


@dataclass(frozen=True)
class Decision:
    """Settings of GSPure, and the files of its steps; a step with the same settings is shared with another decision."""

    settings: MethodSettings
    files: Mapping[str, Path]

    @property
    def thresholded(self) -> Path:
        """The file that the pruning factors apply to."""
        return self.files["weights.npy" if self.settings.prunes_by_weight else "opacities.npy"]


@dataclass(frozen=True)
class CameraSource:
    """Where views come from: a file, a folder, or a way to generate them; and their image size."""

    source: str
    resolution: str
    generated: Mapping[str, float | int | tuple[float, ...] | None] = field(default_factory=dict)


@dataclass(frozen=True)
class Embedding:
    """The training of a scheme on a pair."""

    pair: Path
    initialization: str
    seed: int
    settings: Mapping[str, Setting]
    files: tuple[Path, ...]  # of the pair, which the training reads


@dataclass(frozen=True)
class ModelPlan:
    """A model: its files, its views, its decisions and its jobs, in the order of tables."""

    id: ModelId
    public: Path
    modules: tuple[str, ...]  # that read it
    cameras: Mapping[str, CameraSource]  # of the scene and, with an owner, of the message
    decisions: Mapping[str, Decision]
    variants: tuple[Job, ...]
    controls: tuple[Job, ...] = ()
    owner: Owner | None = None
    embedding: Embedding | None = None
    condition: Condition = field(default_factory=lambda: Condition(""))
    targets: tuple[str, ...] = (SCENE,)
    photographs: Path | None = None  # folder with the truth of `SCENE` and `MESSAGE`
    inputs: tuple[Path, ...] = ()  # what other jobs make of it: the public model, unless it is the user's
    users_files: tuple[Path, ...] = ()
    camera_inputs: tuple[Path, ...] = ()  # files of cameras that other jobs make
    camera_files: tuple[Path, ...] = ()  # the user's files of cameras
    has_small_images: bool = False

    @property
    def folder(self) -> Path:
        """The folder of its results."""
        return self.id.folder

    @property
    def jobs(self) -> tuple[Job, ...]:
        """Its variants, then its controls."""
        return (*self.variants, *self.controls)

    @property
    def method(self) -> Decision:
        """The decision with the settings of `method` in the configuration."""
        return self.decisions[METHOD]

    @cached_property
    def by_variant(self) -> dict[str, Job]:
        """Its jobs by variant or control."""
        return {job.variant: job for job in self.jobs}


@dataclass(frozen=True)
class Candidates:
    """Pictures of the kind of ray-traced messages: the pairs' settings, and the number of scenes."""

    builder: str
    placement: str
    views: int  # of a pair
    width: int
    height: int
    split: Split  # of these views
    count: int

    @property
    def name(self) -> str:
        """The name of its file, without ``.npy``."""
        kind = f"{self.builder}-{self.placement}"
        return f"{kind}-{self.width}x{self.height}x{self.views}-{self.split}-{self.count}"

    @property
    def file(self) -> Path:
        """Its file: uint8 [N,V,H/2,W/2,3]."""
        return RESULTS / "candidates" / f"{self.name}.npy"


@dataclass(frozen=True)
class Preparation:
    """A command that makes a pair, or trains a model: its sources, its options, and the user's files it reads."""

    sources: tuple[str, ...]
    options: Mapping[str, str | int | None]
    users_files: tuple[Path, ...] = ()
    inputs: tuple[Path, ...] = ()  # files that other jobs make
    has_small_images: bool = False


@dataclass(frozen=True)
class Plan:
    """All models of a run, what is trained for them, and the groups of variants that the report compares.

    Sweeps are variants that are one attack at several strengths; `attacks` are the same, also of a single strength.
    `factors` are tau_n and tau_c of the variants that differ from GSPure in these alone, by scheme. `meanings` say what
    the attack of a variant does.
    """

    models: tuple[ModelPlan, ...]
    pairs: Mapping[str, Preparation] = field(default_factory=dict)
    messages: Mapping[str, Preparation] = field(default_factory=dict)
    trained: Mapping[str, Preparation] = field(default_factory=dict)  # models of the user's photographs, by scene
    candidates: Mapping[str, Candidates] = field(default_factory=dict)  # by name
    sweeps: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    attacks: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    factors: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    meanings: Mapping[str, str] = field(default_factory=dict)
    suite: str = ""  # whose variants these are; empty for variants of the configuration's own

    @cached_property
    def by_name(self) -> dict[str, ModelPlan]:
        """The models by ``SCHEME/SCENE``."""
        return {model.id.name: model for model in self.models}

    @property
    def schemes(self) -> dict[str, None]:
        """The schemes of marked models, in their order."""
        return dict.fromkeys(model.id.scheme for model in self.models if model.owner)

    @property
    def users_files(self) -> dict[Path, None]:
        """All files of the user's that its steps read."""
        files = [file for model in self.models for file in (*model.users_files, *model.camera_files)]
        files += [file for model in self.models for job in model.jobs for file in job.users_files]
        return dict.fromkeys(files)


def read_plan(results: Path) -> Plan:
    """Return the plan of a folder of results, or raise `InputError`."""
    plan: Plan = read(Plan, read_json(results / PLAN_FILE), results / PLAN_FILE)
    return plan


def kind_of(target: str) -> str:
    """Return whose views a target has: those of the scene, or of the message."""
    return SCENE if target == SCENE else MESSAGE
