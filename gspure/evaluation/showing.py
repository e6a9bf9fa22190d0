"""What a job shows: the renders of a model, and the extractions of its message."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gspure.arrays import Float32, Float64
from gspure.attacks import Attacked
from gspure.attacks.attacked import Retouch
from gspure.attacks.strength import scene_renders
from gspure.cameras import Camera
from gspure.evaluation.attacking import AttackResult
from gspure.evaluation.plan import Job, kind_of
from gspure.images import write_image
from gspure.metrics.damage import Shown
from gspure.metrics.targets import ADAPTIVE, SCENE
from gspure.model import Gaussians
from gspure.opencl.device import choose_device
from gspure.progress import track
from gspure.public_model import Lesson, PublicModel
from gspure.schemes.matching import registered
from gspure.schemes.pair import Capture
from gspure.schemes.registry import read_public_model
from gspure.schemes.scheme import FIT_STEPS, Key


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
    """Return the model that a control shows."""
    public = read_public_model(job.public, job.owner.scheme if job.owner else None)
    return Exhibit(public, job.public, job.rendered, job.compared)


def scene_after(exhibit: Exhibit, views: Sequence[Camera]) -> Shown:
    """Return what the model shows of the scene, in views that moved with it."""
    moved = [view.moved(exhibit.transform) for view in views]
    drawable = exhibit.public.drawable(exhibit.source)
    return scene_renders(drawable, track(moved, SCENE), choose_device(), exhibit.retouched)


def render(
    job: Job, exhibit: Exhibit, views: Mapping[str, Sequence[Camera]], key: Key | None, scene: Sequence[Float32]
) -> None:
    """Write the images of all targets; an adaptive extraction finds out itself how the model moved."""
    for target in exhibit.rendered:
        transform = np.eye(4) if target == ADAPTIVE else exhibit.transform
        moved = [view.moved(transform) for view in views[kind_of(target)]]
        if target == SCENE:
            shown = zip(moved, scene, strict=True)
        elif key is not None:
            images = extraction(job, exhibit.public.drawn(exhibit.source), key, target, moved)
            shown = zip(track(moved, target), images, strict=True)
        else:
            continue
        for camera, image in shown:
            write_image(job.folder / "renders" / target / f"{camera.name}.png", image)


def extraction(job: Job, public: PublicModel, key: Key, target: str, views: list[Camera]) -> Iterator[Float32]:
    """Yield what an extraction shows in views; an owner who adapts has the published model, perhaps photographs."""
    if target == ADAPTIVE and job.owner:
        if job.owner.published_model:
            public = registered(public, published_rows(job.owner.published_model, job.owner.scheme))
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
