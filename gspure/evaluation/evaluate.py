"""The job of one variant or control: attack, render, extract, read marks, and compare with the references."""

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import save_array
from gspure.attacks import NotApplicable
from gspure.attacks.strength import Damage, scene_damage
from gspure.cameras import Camera
from gspure.cameras.splits import read_split
from gspure.codec import plain
from gspure.evaluation.attack_record import ATTACK_RECORD, Applied, AttackRecord, Refused
from gspure.evaluation.attacking import Context, attacked
from gspure.evaluation.comparing import bits_evidence, compared, image_pairs, picture_evidence, scene_change
from gspure.evaluation.evidence import EVIDENCE, JobEvidence
from gspure.evaluation.plan import AttackSpec, Detector, Job
from gspure.evaluation.showing import Exhibit, attacked_exhibit, control_exhibit, render, scene_after
from gspure.files import write_json
from gspure.metrics.comparison import ViewMetrics, write_metrics
from gspure.metrics.csv_tables import write_table
from gspure.metrics.damage import Shown
from gspure.metrics.detection import DETECTIONS
from gspure.metrics.readings import Reading, read_marks
from gspure.metrics.targets import BITS, MESSAGE, MODEL_BITS, SCENE
from gspure.model import model_file
from gspure.opencl.device import Device, choose_device
from gspure.progress import tell
from gspure.provenance import bind_rows, write_provenance
from gspure.public_model import PublicModel
from gspure.schemes.registry import find_scheme, read_public_model
from gspure.schemes.scheme import Key
from gspure.training.dataset import read_photographs

WRONG_KEY_SEED: Final = 1


@dataclass(frozen=True)
class Evaluation:
    """What a job found: the outcome of its attack, metrics and readings of its images, and evidence of the message."""

    attack: Applied | Refused | None = None  # None for a control
    metrics: tuple[ViewMetrics, ...] = ()
    readings: Mapping[str, tuple[Reading, ...]] = field(default_factory=dict)
    evidence: JobEvidence = field(default_factory=JobEvidence)


def evaluate(job: Job) -> Evaluation:
    """Run a job: write the attacked model and images to its folder, and return what they show.

    Raise `InputError` if the model, a view, the key or a setting is invalid. An attack that cannot apply is an outcome.
    """
    renders = job.folder / "renders"
    for folder in (renders, job.folder / DETECTIONS):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
    views = read_views(job)
    attack: Applied | Refused | None = None
    before: PublicModel | None = None
    if isinstance(job.case, AttackSpec):
        before = read_public_model(job.public, job.owner.scheme if job.owner else None).drawable(job.public)
        attack, exhibit = run_attack(job, job.case, views, before)
        if exhibit is None:
            return Evaluation(attack)
    else:
        exhibit = control_exhibit(job)
    shows_scene = before is not None or SCENE in exhibit.rendered
    scene = scene_after(exhibit, views[SCENE]) if shows_scene else Shown((), ())
    key = owners_key(job)
    render(job, exhibit, views, key, scene.images)
    pairs = image_pairs(job, exhibit, views)
    marks = readings(job, exhibit, key)
    evidence = JobEvidence(
        scene=scene_change(job, before, views[SCENE], scene) if before else None,
        pictures=picture_evidence(job, exhibit, views, key, pairs),
        bits=bits_evidence(job, key, marks),
    )
    return Evaluation(attack, tuple(compared(job, pairs)), marks, evidence)


def write(job: Job, evaluation: Evaluation) -> None:
    """Write the tables of an evaluation beside the images of its job."""
    folder = job.folder
    if evaluation.attack is not None:
        write_json(folder / ATTACK_RECORD, plain(AttackRecord(evaluation.attack)))
    is_empty = isinstance(evaluation.attack, Refused)
    if evaluation.metrics or is_empty:
        write_metrics(folder / "metrics.csv", evaluation.metrics)
    for name, rows in evaluation.readings.items():
        write_table(folder / DETECTIONS / f"{name}.csv", Reading, rows)
    write_json(folder / EVIDENCE, plain(evaluation.evidence))
    if not is_empty:
        write_provenance(folder, "evaluate", inputs={"model": job.public}, settings=plain(job))


def read_views(job: Job) -> dict[str, list[Camera]]:
    """Return the views of the scene and, with an owner, of the message."""
    views = {SCENE: read_split(job.views.cameras, job.views.split)}
    if job.owner:
        views[MESSAGE] = read_split(job.owner.message_cameras, job.views.split)
    return views


def owners_key(job: Job) -> Key | None:
    """Return the key of the message, or an unrelated one for that control; None without an owner."""
    if job.owner is None:
        return None
    key = find_scheme(job.owner.scheme).read_key(job.owner.key)
    if job.control and job.control.has_wrong_key:
        return key.wrong(np.random.default_rng(WRONG_KEY_SEED))
    return key


def run_attack(
    job: Job, spec: AttackSpec, views: Mapping[str, Sequence[Camera]], before: PublicModel
) -> tuple[Applied | Refused, Exhibit | None]:
    """Attack the public model and write the attacked one; without the exhibit if the attack cannot apply."""
    place = job.folder / "public" / "point_cloud.ply"
    place.parent.mkdir(exist_ok=True)
    scheme = find_scheme(job.owner.scheme) if job.owner else None
    device = choose_device()
    context = Context(
        views=read_split(job.views.cameras, "train"),
        device=device,
        measure_damage=measure_for_views(views[SCENE], device, is_photographed=SCENE in job.views.photographed),
    )
    try:
        attack_result = attacked(before, spec, context)
    except NotApplicable as error:
        tell(str(error))
        save_array(job.folder / "prune_mask.npy", np.zeros(len(before.model), np.bool_))
        return Refused(error.reason), None
    attack_result.public.write(place)
    save_array(job.folder / "prune_mask.npy", attack_result.attacked.prune_mask)
    bind_rows(model_file(job.public), job.folder / "prune_mask.npy")
    settings = {"attack": spec.name, **attack_result.settings, "seed": spec.seed}
    write_provenance(place.parent, "attack", inputs={"model": job.public}, settings=settings)
    tell(attack_result.sentence)
    return attack_result.applied(before, scheme), attacked_exhibit(job, attack_result, place)


def measure_for_views(
    views: Sequence[Camera],
    device: Device,
    *,
    is_photographed: bool,
) -> Callable[[PublicModel], Damage]:
    """Return the function from a public model to the measure of the damage to it in the views of the scene."""

    def measure(public: PublicModel) -> Damage:
        if not is_photographed:
            raise NotApplicable("search", "a damage is a drop of the PSNR against photographs, and there are none")
        return scene_damage(public, views, read_photographs(views, public.model.background), device)

    return measure


def readings(job: Job, exhibit: Exhibit, key: Key | None) -> dict[str, tuple[Reading, ...]]:
    """Return what every detector, and the key of a scheme that hides bits, reads from the renders or the file."""
    images = job.folder / "renders" / SCENE
    sources = {"renders": images, "model": model_file(exhibit.source)}
    marks = {
        name: tuple(command_readings(detector, sources[detector.reads])) for name, detector in job.detectors.items()
    }
    if key is not None and BITS in job.bit_targets:
        marks[BITS] = tuple(key.readings(images))
    if key is not None and MODEL_BITS in job.bit_targets and exhibit.has_rows:
        marks[MODEL_BITS] = tuple(key.model_readings(exhibit.public))
    return marks


def command_readings(detector: Detector, source: Path) -> list[Reading]:
    """Return what a user's command reads from a folder of images, or from a model's file."""
    return read_marks(detector.command, source, detector.message, detector.timeout)
