"""The job of one variant or control: attack, render, extract, read marks, and compare with the references."""

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import Float32, Float64, save_array
from gspure.attacks import Attacked, NotApplicable
from gspure.attacks.attacked import Retouch
from gspure.attacks.strength import Damage, scene_damage
from gspure.cameras import Camera
from gspure.cameras.photographs import photograph
from gspure.cameras.splits import read_split
from gspure.codec import plain
from gspure.evaluation.attacking import AttackResult, Context, attacked
from gspure.evaluation.plan import AttackSpec, Detector, Job, kind_of
from gspure.evaluation.verdict import VERDICT, Applied, AttackRecord, Refused
from gspure.files import write_json
from gspure.images import read_back, write_image
from gspure.method.purify import purify
from gspure.method.weights import evenly_spread
from gspure.metrics.comparison import RENDER, TRUTH, ImagePair, Reference, ViewMetrics, compare, write_metrics
from gspure.metrics.csv_tables import write_table
from gspure.metrics.detection import DETECTIONS
from gspure.metrics.readings import Reading, read_marks
from gspure.metrics.retrieval import Retrieved, retrieved
from gspure.metrics.targets import ADAPTIVE, BITS, MESSAGE, MODEL_BITS, SCENE, is_picture
from gspure.model import Gaussians, model_file
from gspure.opencl.device import Device, choose_device
from gspure.progress import tell, track
from gspure.provenance import write_provenance
from gspure.public_model import Lesson, PublicModel
from gspure.schemes.matching import registered
from gspure.schemes.pair import Capture
from gspure.schemes.registry import find_scheme, read_public_model
from gspure.schemes.scheme import FIT_STEPS, Key
from gspure.training.dataset import read_photographs

WRONG_KEY_SEED: Final = 1


@dataclass(frozen=True)
class Evaluation:
    """What a job found: the outcome of its attack, and metrics, readings and retrieval of its images."""

    attack: Applied | Refused | None = None  # None for a control
    metrics: tuple[ViewMetrics, ...] = ()
    readings: Mapping[str, tuple[Reading, ...]] = field(default_factory=dict)
    retrieval: tuple[Retrieved, ...] = ()


@dataclass(frozen=True)
class Exhibit:
    """A model to show: what the job renders of it, and how."""

    public: PublicModel
    source: Path  # its file, which errors name
    rendered: tuple[str, ...]
    compared: tuple[str, ...]
    has_rows: bool = True  # whether extractions of the scheme can read it
    transform: Float64 = field(default_factory=lambda: np.eye(4))
    retouched: Retouch = Attacked.retouched


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
    if isinstance(job.case, AttackSpec):
        attack, exhibit = run_attack(job, job.case, views)
        if exhibit is None:
            return Evaluation(attack)
    else:
        exhibit = control_exhibit(job)
    key = owners_key(job)
    render(job, exhibit, views, key)
    pairs = image_pairs(job, exhibit, views)
    extractions = {target: pairs[target] for target in exhibit.rendered if is_picture(target) and target in pairs}
    decoys = job.owner.decoys if job.owner else ()
    return Evaluation(
        attack=attack,
        metrics=tuple(compared(job, pairs)),
        readings=readings(job, exhibit, key),
        retrieval=tuple(retrieved(job.variant, extractions, decoys)),
    )


def write(job: Job, evaluation: Evaluation) -> None:
    """Write the tables of an evaluation beside the images of its job."""
    folder = job.folder
    if evaluation.attack is not None:
        write_json(folder / VERDICT, plain(AttackRecord(evaluation.attack)))
    is_empty = isinstance(evaluation.attack, Refused)
    if evaluation.metrics or is_empty:
        write_metrics(folder / "metrics.csv", evaluation.metrics)
    for name, rows in evaluation.readings.items():
        write_table(folder / DETECTIONS / f"{name}.csv", Reading, rows)
    write_table(folder / "retrieval.csv", Retrieved, evaluation.retrieval)
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
    job: Job, spec: AttackSpec, views: Mapping[str, Sequence[Camera]]
) -> tuple[Applied | Refused, Exhibit | None]:
    """Attack the public model and write the attacked one; without the exhibit if the attack cannot apply."""
    place = job.folder / "public" / "point_cloud.ply"
    place.parent.mkdir(exist_ok=True)
    scheme = find_scheme(job.owner.scheme) if job.owner else None
    before = read_public_model(job.public, scheme.name if scheme else None).drawable(job.public)
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
        photographs = read_photographs(views, public.model.background) if is_photographed else None
        return scene_damage(public, views, photographs, device)

    return measure


def attacked_exhibit(job: Job, attack_result: AttackResult, place: Path) -> Exhibit:
    """Return an attacked model to show; a removed format is vanilla 3DGS, which no extraction of the scheme reads."""
    is_removed = bool(attack_result.attacked.removed)
    return Exhibit(
        public=attack_result.public,
        source=place,
        rendered=(SCENE,) if is_removed else job.rendered,
        compared=(SCENE,) if is_removed else job.compared,
        has_rows=not is_removed,
        transform=attack_result.transform,
        retouched=attack_result.attacked.retouched,
    )


def control_exhibit(job: Job) -> Exhibit:
    """Return the model that a control shows, perhaps after GSPure."""
    public = read_public_model(job.public, job.owner.scheme if job.owner else None)
    settings = job.control.purified if job.control else None
    if settings is not None:
        public = public.drawable(job.public)
        views = read_split(job.views.cameras, "train")
        if settings.views:
            views = evenly_spread(views, settings.views)
        purification = purify(public, views, device=choose_device(), **settings.of_purify)
        save_array(job.folder / "prune_mask.npy", purification.prune_mask)
        public = public.with_model(purification.model)
    return Exhibit(public, job.public, job.rendered, job.compared)


def render(job: Job, exhibit: Exhibit, views: Mapping[str, Sequence[Camera]], key: Key | None) -> None:
    """Write the images of all targets; an adaptive extraction finds out itself how the model moved."""
    for target in exhibit.rendered:
        transform = np.eye(4) if target == ADAPTIVE else exhibit.transform
        moved = [view.moved(transform) for view in views[kind_of(target)]]
        if target == SCENE:
            drawable = exhibit.public.drawable(exhibit.source)
            images: Iterator[Float32] = map(drawable.scene(choose_device(), drawable.model.background), moved)
        elif key is not None:
            images = extraction(job, exhibit.public.drawn(exhibit.source), key, target, moved)
        else:
            continue
        for camera, image in zip(track(moved, target), images, strict=True):
            shown = exhibit.retouched(read_back(image), camera.name) if target == SCENE else image
            write_image(job.folder / "renders" / target / f"{camera.name}.png", shown)


def extraction(job: Job, public: PublicModel, key: Key, target: str, views: list[Camera]) -> Iterator[Float32]:
    """Yield what an extraction shows in views; an owner who adapts has the published model, perhaps photographs."""
    if target == ADAPTIVE and job.owner:
        if job.owner.published:
            public = registered(public, published_rows(job.owner.published, job.owner.scheme))
        if job.owner.photographs:
            key = fitted_key(key, public, job.owner.photographs)
    return key.images(public, target, views, choose_device())


def published_rows(published: Path, scheme: str) -> Gaussians:
    """Return the rows of the published model."""
    return read_public_model(published, scheme).drawn(published).model


def fitted_key(key: Key, public: PublicModel, photographs: Path) -> Key:
    """Return the key after learning from photographs of the message."""
    capture = Capture.read(photographs)
    views = [camera.moved(np.eye(4)) for camera in capture.views]
    lesson = Lesson(views, capture.images, (), FIT_STEPS, np.random.default_rng(0), device=choose_device())
    return key.fitted(public, lesson)


def readings(job: Job, exhibit: Exhibit, key: Key | None) -> dict[str, tuple[Reading, ...]]:
    """Return what every detector, and the key of a scheme that hides bits, reads from the renders or the file."""
    images = job.folder / "renders" / SCENE
    sources = {"renders": images, "model": model_file(exhibit.source)}
    marks = {
        name: tuple(command_readings(detector, sources[detector.reads])) for name, detector in job.detectors.items()
    }
    if key is not None and BITS in job.bits:
        marks[BITS] = tuple(key.readings(images))
    if key is not None and MODEL_BITS in job.bits and exhibit.has_rows:
        marks[MODEL_BITS] = tuple(key.model_readings(exhibit.public))
    return marks


def command_readings(detector: Detector, source: Path) -> list[Reading]:
    """Return what a user's command reads from a folder of images, or from a model's file."""
    return read_marks(detector.command, source, detector.message, detector.timeout)


def image_pairs(job: Job, exhibit: Exhibit, views: Mapping[str, Sequence[Camera]]) -> dict[str, list[ImagePair]]:
    """Return the renders of each compared target, with photographs of their views or renders of the unattacked model.

    A baseline has no renders: the unattacked ones stand in their place until `compare` replaces them.
    """
    is_baseline = job.control is not None and job.control.is_baseline
    renders = job.views.unattacked if is_baseline else job.folder / "renders"
    pairs: dict[str, list[ImagePair]] = {}
    for target in sorted(exhibit.compared):
        kind = kind_of(target)
        pairs[target] = []
        for view in views[kind]:
            unattacked = job.views.unattacked / kind / f"{view.name}.png"
            reference = photograph(view) if kind in job.views.photographed else unattacked
            pairs[target].append(ImagePair(target, view.name, reference, renders / target / f"{view.name}.png"))
    return pairs


def compared(job: Job, pairs: Mapping[str, Sequence[ImagePair]]) -> Iterator[ViewMetrics]:
    """Yield the metrics of every view of every compared target."""
    baseline = job.control.name if job.control and job.control.is_baseline else None
    for target, images in pairs.items():
        reference: Reference = TRUTH if kind_of(target) in job.views.photographed else RENDER
        for pair in images:
            yield compare(pair, reference, baseline)
