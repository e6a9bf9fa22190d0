"""Attacks that train on renders of the public model at public cameras: no photographs, no key, no message."""

from collections.abc import Sequence
from functools import cached_property
from typing import Final

import numpy as np

from gspure.attacks.attack import Rng, named
from gspure.attacks.attacked import Attacked, NotApplicable, require
from gspure.cameras.camera import Camera
from gspure.constants import TAU_C, TAU_N
from gspure.errors import InputError
from gspure.files import Bools, Float32, Int32
from gspure.images import read_back
from gspure.method import pruning
from gspure.model.gaussians import Gaussians
from gspure.opencl.device import Device
from gspure.progress import track
from gspure.public_model import Lesson, PublicModel
from gspure.settings import Factor, Steps
from gspure.training.dataset import extent
from gspure.training.initialization import LEAST_POINTS, consistent_points, gaussians_at
from gspure.training.trainer import beginning, train

ITERATIONS: Final = 200  # training steps of an existing model; ours
DISTILLATION: Final = 1500  # training steps of a new model; ours
RATE_FACTOR: Final = 10.0  # factor on the learning rates of `reestimate`, whose colours start at zero; ours

LEARNED: Final = {
    "all": ("colour", "opacity", "scale", "rotation", "position"),
    "appearance": ("colour", "opacity"),
    "colour": ("colour",),
}
"""Trained attributes, by value of `learn`."""


class Teacher:
    """The renders of a public model at public cameras, to train other models on; errors name the `attack`."""

    def __init__(self, attack: str, public: PublicModel, cameras: Sequence[Camera], device: Device | None) -> None:
        self.attack, self.public, self.cameras, self.device = attack, public, cameras, device
        self.background = public.model.background

    @cached_property
    def images(self) -> list[Float32]:
        """Its renders, as 8-bit images show them."""
        if not self.cameras:
            raise InputError(f"attack {self.attack}", "cameras", expected="public views", found="none")
        scene = self.public.scene(self.device, self.background)
        return [read_back(scene(camera)) for camera in track(self.cameras, "renders to learn")]

    def train(self, student: PublicModel, rng: Rng, iterations: int, learn: str, rate_factor: float = 1.0) -> Gaussians:
        """Return the rows of `student` after training the attributes that `learn` names."""
        require(self.attack, "learn", learn, f"one of {', '.join(LEARNED)}", fits=learn in LEARNED)
        how = (iterations, rng, rate_factor, self.device, self.background)
        return student.learned(Lesson(self.cameras, self.images, LEARNED[learn], *how)).model


def finetune(
    _model: Gaussians,
    rng: Rng,
    public: PublicModel,
    cameras: Sequence[Camera],
    device: Device | None,
    *,
    iterations: Steps = ITERATIONS,
    learn: str = "all",
) -> Attacked:
    """Train the attributes that `learn` names (`LEARNED`) on the model's own renders for `iterations` steps."""
    rows = Teacher("finetune", public, cameras, device).train(public, rng, iterations, learn)
    return Attacked(rows, np.arange(len(rows)), len(rows))


def prune_repair(
    _model: Gaussians,
    rng: Rng,
    weights: Float32,
    public: PublicModel,
    cameras: Sequence[Camera],
    device: Device | None,
    *,
    tau: Factor = TAU_N,
    iterations: Steps = ITERATIONS,
    learn: str = "all",
) -> Attacked:
    """Remove the rows with ω_k < ω̄ / `tau`, then train the rest on renders of the unpruned model, as `finetune`."""
    teacher = Teacher("prune_repair", public, cameras, device)
    return _repaired(teacher, pruning.plain_prune_mask(weights, tau), rng, iterations, learn)


def gspure_repair(
    _model: Gaussians,
    rng: Rng,
    weights: Float32,
    labels: Int32,
    public: PublicModel,
    cameras: Sequence[Camera],
    device: Device | None,
    *,
    scale: Factor = 1.0,
    tau_c: Factor = TAU_C,
    tau_n: Factor = TAU_N,
    iterations: Steps = ITERATIONS,
    learn: str = "all",
) -> Attacked:
    """Remove the rows that `gspure_scaled` removes, then train the rest as `prune_repair`."""
    teacher = Teacher("gspure_repair", public, cameras, device)
    return _repaired(teacher, pruning.prune_mask(labels, weights, scale * tau_c, scale * tau_n), rng, iterations, learn)


def _repaired(teacher: Teacher, prune_mask: Bools, rng: Rng, iterations: int, learn: str) -> Attacked:
    """Remove rows of the teacher's model, and train the rest on its renders."""
    pruned = teacher.public.with_model(teacher.public.model[~prune_mask])
    rows = teacher.train(pruned, rng, iterations, learn)
    return Attacked(rows, np.flatnonzero(~prune_mask), len(prune_mask))


def reestimate(
    _model: Gaussians,
    rng: Rng,
    public: PublicModel,
    cameras: Sequence[Camera],
    device: Device | None,
    *,
    iterations: Steps = ITERATIONS,
) -> Attacked:
    """Set all colours or features to zero and train them again; geometry, decoder and networks are not changed."""
    zeros = dict.fromkeys(public.columns["colour"], np.zeros(len(public.model), np.float32))
    blank = public.with_model(public.model.with_columns(zeros))
    rows = Teacher("reestimate", public, cameras, device).train(blank, rng, iterations, "colour", RATE_FACTOR)
    return Attacked(rows, np.arange(len(rows)), len(rows))


def distil(
    model: Gaussians,
    rng: Rng,
    public: PublicModel,
    cameras: Sequence[Camera],
    device: Device | None,
    *,
    iterations: Steps = DISTILLATION,
) -> Attacked:
    """Train a new vanilla 3DGS model on the renders of a vanilla one, from points that the renders agree on.

    The result depends on the model only through its renders at `cameras`, its background and its number of rows
    (docs/limits.md).
    """
    if type(public).attributes is not PublicModel.attributes:
        raise NotApplicable("distil", "no extraction of this format could read a vanilla model")
    images = Teacher("distil", public, cameras, device).images
    points, colours = consistent_points(cameras, images, extent(cameras), rng)
    if len(points) < LEAST_POINTS:
        raise NotApplicable("distil", f"views share {len(points)} points, and training starts from {LEAST_POINTS}")
    start = beginning(gaussians_at(points, colours), int(rng.integers(2**31)))
    distilled = train(
        *(cameras, images, start),
        iterations=iterations,
        extent=extent(cameras),
        max_gaussians=len(model),
        device=device,
        background=model.background,
    ).with_comment("vanilla 3DGS distilled from a public model")
    return Attacked(distilled, np.full(len(distilled), -1), len(model))


ATTACKS = named(dict.fromkeys((finetune, prune_repair, gspure_repair, reestimate, distil)))
