"""The jobs of one model: its variants and its negative controls."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from gspure.attacks import BUILT_IN
from gspure.evaluation.identity import ModelId
from gspure.evaluation.plan import METHOD, AttackSpec, Control, Decision, Detector, Job, Owner, Views
from gspure.external import files_of
from gspure.metrics.names import CLEAN, OTHER_SCENE, UNATTACKED, WRONG_KEY, clean_model
from gspure.workflow.inputs import distinct
from gspure.workflow.variants import VariantSpec


@dataclass(frozen=True)
class Subject:
    """A model to evaluate: what its variants and controls have in common."""

    id: ModelId
    public: Path
    modules: tuple[str, ...]  # that read it
    decisions: Mapping[str, Decision]
    views: Views
    targets: tuple[str, ...]
    owner: Owner | None
    detectors: Mapping[str, Detector]
    is_clean: bool = False  # whether it is the clean model of another one, without a mark to read
    clean: tuple[Path, ...] = ()  # public models without the message
    other_scene: Path | None = None  # the public model with another message
    inputs: tuple[Path, ...] = ()  # made by other jobs, and read by each of its own
    users_files: tuple[Path, ...] = ()  # read by each of its jobs
    clean_files: tuple[Path, ...] = ()  # the user's files of the clean model; none if another job trains it
    compares_with_renders: bool = False  # rather than with photographs

    @property
    def bit_targets(self) -> tuple[str, ...]:
        """What the owner's key reads, of `HIDDEN_BITS`."""
        return self.owner.bit_targets if self.owner else ()

    @property
    def hides_picture(self) -> bool:
        """Whether its message is a picture."""
        return self.owner is not None and not self.bit_targets

    @property
    def renders(self) -> Path:
        """The folder of renders before any attack."""
        return self.id.folder / UNATTACKED / "renders"


def variant_job(subject: Subject, name: str, variant: VariantSpec) -> Job:
    """Return the job of a variant."""
    attack = variant.attack
    spec = AttackSpec(
        name=attack.name,
        entry=variant.entry,
        settings=_settings(subject.decisions[variant.decision], variant),
        seed=variant.seed + subject.id.seed,
        damage=variant.damage,
        until=variant.until,
        measured=_measurement_files(subject, variant),
    )
    inputs = (*subject.inputs, *spec.measured.values())
    needs_renders = subject.compares_with_renders and name != UNATTACKED
    return Job(
        model=subject.id,
        variant=name,
        public=subject.public,
        case=spec,
        views=subject.views,
        owner=subject.owner,
        rendered=subject.targets,
        compared=subject.targets,
        detectors={} if subject.is_clean else subject.detectors,
        bit_targets=() if subject.is_clean else subject.bit_targets,
        inputs=distinct((*inputs, subject.renders) if needs_renders else inputs),
        users_files=distinct((*subject.users_files, *_detector_files(subject))),
        modules=(*subject.modules, attack.function.__module__),
    )


def control_job(subject: Subject, name: str) -> Job:
    """Return the job of a control.

    Of controls that show a watermarked model, only the message is of interest.
    """
    shows_mark = name in (WRONG_KEY, OTHER_SCENE)
    rendered = subject.targets[1:] if shows_mark and subject.hides_picture else subject.targets
    compared = () if shows_mark and subject.bit_targets else rendered
    is_read = not subject.is_clean
    public = {**_clean_models(subject), OTHER_SCENE: subject.other_scene}.get(name)
    is_made = public is not None and not (public in subject.clean and subject.clean_files)
    inputs = (*subject.inputs, subject.renders)
    return Job(
        model=subject.id,
        variant=name,
        public=public or subject.public,
        case=Control(name),
        views=subject.views,
        owner=subject.owner,
        rendered=rendered,
        compared=compared,
        detectors=subject.detectors if is_read and name == CLEAN else {},
        bit_targets=subject.bit_targets if is_read else (),
        inputs=distinct((*inputs, public) if public and is_made else inputs),
        users_files=distinct((*subject.users_files, *_detector_files(subject), *subject.clean_files)),
        modules=subject.modules,
    )


def controls_of(subject: Subject) -> tuple[str, ...]:
    """Return the negative controls of a model, in the order of tables."""
    controls = [*_clean_models(subject)]
    if subject.owner:
        controls.append(WRONG_KEY)
        if subject.other_scene:
            controls.append(OTHER_SCENE)
    return tuple(controls)


def _clean_models(subject: Subject) -> dict[str, Path]:
    """Return the clean models of a model, by the control that shows each."""
    return {clean_model(number): public for number, public in enumerate(subject.clean, 1)}


def _settings(decision: Decision, variant: VariantSpec) -> dict[str, float | int | str]:
    """Return the settings of an attack, without a strength to search.

    Pruning factors of a built-in attack that are not set are its decision's.
    """
    attack = variant.attack
    values = dict(variant.settings)
    if attack in BUILT_IN:
        factors = {"tau_c": decision.settings.tau_c, "tau_n": decision.settings.tau_n, "tau": decision.settings.tau_n}
        values = {**{name: value for name, value in factors.items() if value is not None}, **values}
    searched = attack.strength.setting if attack.strength and variant.is_searched else ""
    return {name: value for name, value in values.items() if name in attack.settings and name != searched}


def _measurement_files(subject: Subject, variant: VariantSpec) -> dict[str, Path]:
    """Return the files that an attack needs; weights, masks and labels are those of its decision."""
    decision = subject.decisions[variant.decision]
    needs = variant.attack.needs
    files = {
        "opacities": subject.decisions[METHOD].files["opacities.npy"],
        "surface": subject.id.folder / "surface.npy",
        "weights": decision.files["weights.npy"],
        "prune_mask": decision.files["prune_mask.npy"],
    }
    if "labels" in needs:
        files |= {"labels": decision.files["clusters.npz"], "weights": decision.thresholded}
    return {need: files[need] for need in sorted(needs)}


def _detector_files(subject: Subject) -> list[Path]:
    """Return the user's files that commands of detectors name."""
    if subject.is_clean:
        return []
    return [Path(file) for detector in subject.detectors.values() for file in files_of(detector.command)]
