"""Attacks that train on renders of the public model at public cameras: no photographs, no key, no message."""

from dataclasses import replace
from typing import Final

import numpy as np

from gspure.arrays import Bools, Float32
from gspure.attacks.attack import Rng, Teacher, named
from gspure.attacks.attacked import Attacked, NotApplicable
from gspure.attacks.densifying import densify
from gspure.attacks.remeshing import remesh
from gspure.attacks.renders import retouch
from gspure.constants import TAU_N
from gspure.method import pruning
from gspure.model.gaussians import Gaussians
from gspure.public_model import PublicModel
from gspure.settings import SCHEDULES, Factor, Steps
from gspure.training.dataset import extent
from gspure.training.fast import schedule_of
from gspure.training.initialization import LEAST_POINTS, consistent_points, gaussians_at
from gspure.training.trainer import beginning, train

ITERATIONS: Final = 200  # training steps of an existing model; ours
DISTILLATION: Final = 1500  # training steps of a new model; ours
RATE_FACTOR: Final = 10.0  # factor on the learning rates of `reestimate`, whose colours start at zero; ours
UNCHANGED: Final = "unchanged"  # renders to learn


def finetune(
    _model: Gaussians,
    rng: Rng,
    teacher: Teacher,
    *,
    iterations: Steps = ITERATIONS,
    learn: str = "all",
    render: str = UNCHANGED,
) -> Attacked:
    """Train the attributes that `learn` names on the model's own renders for `iterations` steps.

    `learn` = ``all`` trains everything; of GS-Hider, the features; of SecureGS, features, scalings and offsets.
    ``appearance`` trains colour and opacity, ``colour`` colour; of GS-Hider and SecureGS, both train features. Decoders
    and networks are never trained.

    `render` is an attack on these renders, and its strength after a colon: ``jpeg:50``, ``blur:1``, ``median:1``,
    ``resize:0.5``.

    Source: ours.
    """
    rows = _retouching(teacher, render, rng).train(teacher.public, rng, iterations, learn)
    return Attacked(rows, np.arange(len(rows)), len(rows))


def _retouching(teacher: Teacher, render: str, rng: Rng) -> Teacher:
    """Return a teacher whose renders an attack on renders has changed."""
    if render == UNCHANGED:
        return teacher
    return replace(teacher, retouch=retouch(render, int(rng.integers(2**31))))


def prune_repair(
    _model: Gaussians,
    rng: Rng,
    weights: Float32,
    teacher: Teacher,
    *,
    tau: Factor = TAU_N,
    iterations: Steps = ITERATIONS,
    learn: str = "all",
) -> Attacked:
    """Remove rows as `plain_weight` with `tau` does, then train the rest on renders of the unpruned model.

    `iterations` and `learn` are those of `finetune`.

    Source: ours.
    """
    prune_mask = pruning.plain_prune_mask(weights, tau)
    return _repaired(teacher, prune_mask, rng, iterations, learn)


def gspure_repair(
    _model: Gaussians,
    rng: Rng,
    prune_mask: Bools,
    teacher: Teacher,
    *,
    iterations: Steps = ITERATIONS,
    learn: str = "all",
) -> Attacked:
    """Remove the rows that GSPure decided on, then train the rest on renders of the unpruned model.

    `iterations` and `learn` are those of `finetune`. `gspure purify --repair` runs it.

    Source: ours.
    """
    return _repaired(teacher, prune_mask, rng, iterations, learn)


def _repaired(teacher: Teacher, prune_mask: Bools, rng: Rng, iterations: int, learn: str) -> Attacked:
    """Remove rows of the teacher's model, and train the rest on its renders."""
    pruned = teacher.public.with_model(teacher.public.model[~prune_mask])
    rows = teacher.train(pruned, rng, iterations, learn)
    return Attacked(rows, np.flatnonzero(~prune_mask), len(prune_mask))


def reestimate(model: Gaussians, rng: Rng, teacher: Teacher, *, iterations: Steps = ITERATIONS) -> Attacked:
    """Set all colours or features to zero and train them again in `iterations` steps.

    Geometry, decoder and networks are not changed.

    Source: ours.
    """
    zeros = dict.fromkeys(teacher.public.columns["colour"], np.zeros(len(model), np.float32))
    blank = teacher.public.with_model(model.with_columns(zeros))
    rows = teacher.train(blank, rng, iterations, "colour", RATE_FACTOR)
    return Attacked(rows, np.arange(len(rows)), len(rows))


def distil(
    model: Gaussians,
    rng: Rng,
    teacher: Teacher,
    *,
    iterations: Steps = DISTILLATION,
    schedule: str = SCHEDULES[0],
    render: str = UNCHANGED,
) -> Attacked:
    """Train a new vanilla 3DGS model on the renders of any model, from points that the renders agree on.

    The result depends on the model only through its renders, its background and its number of Gaussians
    (docs/limits.md). The `schedule` of the `iterations` steps is ``vanilla`` or ``fast``. `render` is an attack on
    these renders, and its strength after a colon: ``jpeg:50``.

    Source: ours.
    """
    teacher = _retouching(teacher, render, rng)
    is_vanilla = type(teacher.public).attributes is PublicModel.attributes
    per_row = max(1, len(model.columns_named("f_offset_")) // 3)  # Gaussians of an anchor
    cameras = teacher.cameras
    images = teacher.images
    scene_extent = extent(cameras)
    points, colours = consistent_points(cameras, images, scene_extent, rng)
    if len(points) < LEAST_POINTS:
        raise NotApplicable("distil", f"views share {len(points)} points, and training starts from {LEAST_POINTS}")
    start = beginning(gaussians_at(points, colours), int(rng.integers(2**31)))
    distilled = train(
        cameras,
        images,
        start,
        schedule=schedule_of(schedule, iterations),
        extent=scene_extent,
        max_gaussians=per_row * len(model),
        device=teacher.device,
        background=model.background,
    ).with_comment("vanilla 3DGS distilled from a public model")
    removed = "" if is_vanilla else "no extraction of this format reads vanilla 3DGS"
    return Attacked(distilled, np.full(len(distilled), -1), len(model), removed=removed)


ATTACKS = named(
    {
        finetune: None,
        prune_repair: None,
        gspure_repair: None,
        reestimate: None,
        distil: None,
        densify: None,
        remesh: None,
    }
)
