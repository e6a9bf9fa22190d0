"""Two models with one geometry, trained together: the same Gaussians, with two opacities and two colours each."""

from collections.abc import Sequence

import numpy as np

from gspure.cameras.camera import Camera
from gspure.files import Float32
from gspure.opencl.adam import LearningRates
from gspure.opencl.device import Device
from gspure.opencl.engine import Style
from gspure.opencl.trainable import Statistics, TrainableModel, TrainState

States = tuple[TrainState, TrainState]


class TwinModel:
    """Gaussians that learn two scenes: means, quaternions and scales from both, opacities and colours from one each.

    Results are the same to the last bit from run to run and for any number of threads. Both states have the same
    geometry, bit for bit. The second scene's loss has this `weight` for the geometry, that of the first 1.
    """

    def __init__(self, states: States, weight: float, device: Device | None = None, style: Style | None = None) -> None:
        first = TrainableModel(states[0], 0, device, style)
        self.models = (first, TrainableModel(states[1], beside=first))
        self._weight = weight

    @property
    def count(self) -> int:
        """Number of Gaussians."""
        return self.models[0].count

    def set_targets(self, first: Sequence[Float32], second: Sequence[Float32]) -> None:
        """Upload the photographs [H,W,3] of both scenes, view by view."""
        for model, images in zip(self.models, (first, second), strict=True):
            model.set_targets(images)

    def use_sh_degree(self, degree: int) -> None:
        """Use spherical harmonics up to this degree."""
        for model in self.models:
            model.sh_degree_active = degree

    def step(
        self,
        cameras: tuple[Camera, Camera],
        targets: tuple[int, int],
        rates: LearningRates,
        background: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> float:
        """Render each scene at its camera, and move every parameter; return the first loss plus the weighted second."""
        tasks = zip(self.models, cameras, targets, strict=True)
        views = [model.differentiate(camera, target, background) for model, camera, target in tasks]
        (loss, rendered, gradients), (second_loss, second_rendered, second_gradients) = views
        engine = self.models[0].engine
        engine.program("vector", "layout", "statistics", "twins").launch(
            "share_gradients",
            engine.vectors(self.count),
            *(self.count, float(self._weight), int(np.array_equal(cameras[0].numbers, cameras[1].numbers))),
            *(size / 2 for camera in cameras for size in (camera.width, camera.height)),
            *(rendered.projected.depth_keys, second_rendered.projected.depth_keys),
            *(gradients.geometry, second_gradients.geometry, gradients.centres, second_gradients.centres),
            *self.models[0].statistics_buffers,
        )
        for model, (_, _, model_gradients) in zip(self.models, views, strict=True):
            model.update(rates, model_gradients)
        return loss + self._weight * second_loss

    def statistics(self) -> Statistics:
        """Read the statistics of the sum of both losses."""
        return self.models[0].statistics()

    def states(self) -> States:
        """Read parameters and moments."""
        first, second = (model.state() for model in self.models)
        return first, second

    def replace(self, states: States) -> None:
        """Continue from `states`, of any number of Gaussians, with statistics of zero."""
        for model, state in zip(self.models, states, strict=True):
            model.replace(state)
