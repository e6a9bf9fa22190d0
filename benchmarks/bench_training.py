"""One iteration of training, whole and stage by stage, beside a frame without gradients."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from benchmarks.findings import Findings
from benchmarks.room import camera, room
from benchmarks.stages import Stages
from benchmarks.timing import Measure
from gspure.cameras.camera import Camera
from gspure.constants import BLOCK, GEOMETRY_ATTRIBUTES
from gspure.model import Gaussians
from gspure.opencl.adam import Adam, LearningRates, Moments
from gspure.opencl.engine import Engine, Style
from gspure.opencl.frame import Traversal
from gspure.opencl.gradients import DeviceGradients, blend_band_backward, project_backward
from gspure.opencl.losses import SSIM_WEIGHT, upload_photographs
from gspure.opencl.trainable import Parameters, TrainableModel, TrainState

TRAVERSAL = Traversal("ewa", channels=3, sh_degree=3)
AT_REST = LearningRates(*(0.0,) * 6)
"""Adam does all its work, but every iteration meets the same model."""
ITERATIONS = 5
"""In a row, as in training: the host prepares an iteration while the device still computes the one before."""


@dataclass(frozen=True)
class Case:
    """A room of `count` Gaussians and the size of its photograph.

    Goals: at least `least_speed` iterations per second on two cores; an iteration takes at most `most_frames` frames.
    """

    name: str
    count: int
    width: int
    height: int
    least_speed: float | None
    most_frames: float | None

    @property
    def camera(self) -> Camera:
        """The view."""
        return camera(self.width, self.height)

    @property
    def photograph(self) -> np.ndarray:
        """Noise: what is learned does not matter."""
        return np.random.default_rng(0).random((self.height, self.width, 3), np.float32)


each_case = pytest.mark.parametrize(
    "case",
    [
        Case("20k @160x120", 20_000, 160, 120, least_speed=100.0, most_frames=None),
        Case("100k @320x240", 100_000, 320, 240, least_speed=None, most_frames=2.6),
        Case("200k @640x480", 200_000, 640, 480, least_speed=None, most_frames=2.5),
    ],
    ids=lambda case: case.name,
)


class TrainingStages(Stages):
    """The stages of one iteration: those of a frame, and those from its image back to its parameters."""

    image_gradient: object
    splat_gradients: object
    gradients: DeviceGradients

    def __init__(self, engine: Engine, model: Gaussians, case: Case) -> None:
        super().__init__(engine, model, case.camera, TRAVERSAL)
        (self.photograph,) = upload_photographs(engine, [case.photograph])
        attributes = TRAVERSAL.channel_attributes
        # The optimizer moves parameters of its own; those that are rendered stay as they are.
        geometry = self._moments(GEOMETRY_ATTRIBUTES)
        channels = self._moments(attributes)
        activated = self._zeros(GEOMETRY_ATTRIBUTES)
        self.optimizer = Adam(engine, self.frame.storage.count, geometry, channels, attributes, activated)

    def loss(self) -> None:
        """Compare the image with the photograph."""
        _, self.image_gradient = self.photograph.compare(self.canvas.image, SSIM_WEIGHT)
        self.engine.queue.finish()

    def blend_backward(self) -> None:
        """Carry the image's gradient to the splats."""
        arguments = (self.projected, self.lists, self.canvas, self.image_gradient)
        self.splat_gradients = blend_band_backward(self.frame, *arguments)
        self.engine.queue.finish()

    def project_backward(self) -> None:
        """Carry the splats' gradients to the Gaussians."""
        self.gradients = project_backward(self.frame, self.projected, self.splat_gradients)
        self.engine.queue.finish()

    def adam(self) -> None:
        """Take a step."""
        self.optimizer.step(1, AT_REST, self.gradients)
        self.engine.queue.finish()

    def _moments(self, floats: int) -> Moments:
        return Moments(raw=self._zeros(floats), first=self._zeros(floats), second=self._zeros(floats))

    def _zeros(self, floats: int) -> object:
        nbytes = 4 * floats * (self.frame.storage.count + BLOCK)
        buffer = self.engine.allocate(nbytes)
        self.engine.clear(buffer, nbytes)
        return buffer


@each_case
def test_stages_of_training(case: Case, engine: Engine, measure: Measure, findings: Findings) -> None:
    stages = TrainingStages(engine, room(case.count), case)
    times = measure(
        {
            "project": stages.project,
            "sort by depth": stages.sort,
            "bin": stages.bin,
            "blend": stages.blend,
            "loss": stages.loss,
            "blend backward": stages.blend_backward,
            "project backward": stages.project_backward,
            "Adam": stages.adam,
        },
        rounds=31,
    )
    findings.figure("visible Gaussians", stages.order.visible)
    findings.figure("tile entries", stages.entries())
    findings.figure("blend backward / blend", times["blend backward"] / times["blend"], at_most=2.0)
    learning = times["loss"] + times["Adam"]
    findings.figure("(loss + Adam) / blend backward", learning / times["blend backward"], at_most=0.6)


@each_case
def test_iteration(case: Case, measure: Measure, findings: Findings) -> None:
    model = trainable(room(case.count))
    model.set_targets([case.photograph])

    def repeat(run: Callable[[], object]) -> None:
        for _ in range(ITERATIONS):
            run()
        model.image(case.camera)  # waits for all of it

    times = measure(
        {
            "one frame more": lambda: repeat(lambda: None),
            "frames": lambda: repeat(lambda: model.image(case.camera)),
            "iterations": lambda: repeat(lambda: model.step(case.camera, 0, AT_REST)),
        },
        rounds=21,
    )
    frame = np.array(times["one frame more"].per_core)
    frames = np.array(times["frames"].per_core)
    iterations = np.array(times["iterations"].per_core)
    per_iteration = float(np.median(iterations - frame)) / ITERATIONS
    walls = np.subtract(times["iterations"].wall, times["one frame more"].wall)
    findings.figure("iteration / frame", np.median((iterations - frame) / (frames - frame)), at_most=case.most_frames)
    findings.figure("iterations per second, CPU / cores", 1 / per_iteration, at_least=case.least_speed)
    findings.figure("iterations per second, wall", ITERATIONS / np.median(walls))


def trainable(model: Gaussians, style: Style | None = None) -> TrainableModel:
    """Return a model at the beginning of its training."""
    opacities = np.clip(model.opacities, 1e-6, 1 - 1e-6)
    logits = np.log(opacities) - np.log1p(-opacities)
    arrays = (model.means, model.quats, np.log(model.scales), logits, model.sh_coeffs)
    state = TrainState.fresh(Parameters(*(np.asarray(a, np.float32) for a in arrays)))
    return TrainableModel(state, style=style)
