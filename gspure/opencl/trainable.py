"""A model in training: parameters, Adam's moments, photographs and statistics on the device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, UInt32
from gspure.cameras.camera import Camera
from gspure.constants import BLOCK, GEOMETRY_ATTRIBUTES
from gspure.opencl.adam import Adam, LearningRates, Moments
from gspure.opencl.blending import SUM_GROUP
from gspure.opencl.device import Device, choose_device
from gspure.opencl.engine import Engine, Style
from gspure.opencl.frame import Frame, Traversal
from gspure.opencl.gradients import DeviceGradients, by_row
from gspure.opencl.losses import SSIM_WEIGHT, Photograph, upload_photographs
from gspure.opencl.passes import Rendered, backward, forward
from gspure.opencl.storage import Storage, morton_order, upload_attributes


@dataclass(frozen=True)
class Parameters:
    """Raw parameters by row, as a 3DGS PLY stores them; also their moments, of the same shapes."""

    means: Float32
    quats: Float32
    log_scales: Float32
    opacity_logits: Float32
    sh_coeffs: Float32

    def __len__(self) -> int:
        return len(self.means)

    @property
    def geometry(self) -> Float32:
        """All but the colours, [K,GEOMETRY_ATTRIBUTES]."""
        return np.concatenate([self.means, self.quats, self.log_scales, self.opacity_logits[:, None]], axis=1)

    @property
    def channels(self) -> Float32:
        """The colours, [K,3 S]."""
        return self.sh_coeffs.reshape(len(self), 3 * self.sh_coeffs.shape[1])

    @staticmethod
    def split(geometry: Float32, sh_coeffs: Float32) -> Parameters:
        """Split `geometry` [K,GEOMETRY_ATTRIBUTES] and `sh_coeffs` [K,3 S] into parameters."""
        means, quats, log_scales, logits = map(np.ascontiguousarray, np.split(geometry, [3, 7, 10], axis=1))
        return Parameters(means, quats, log_scales, logits[:, 0], sh_coeffs.reshape(-1, sh_coeffs.shape[1] // 3, 3))

    def rows(self, rows: NDArray[Any]) -> Parameters:
        """Return these rows: indices, or a mask."""
        return Parameters(*(values[rows] for values in vars(self).values()))

    def zeros(self) -> Parameters:
        """Return zeros of the same shapes."""
        return Parameters(*map(np.zeros_like, vars(self).values()))


@dataclass(frozen=True)
class TrainState:
    """Parameters, and Adam's first and second moments of them."""

    parameters: Parameters
    first: Parameters
    second: Parameters

    @staticmethod
    def fresh(parameters: Parameters) -> TrainState:
        """Return the state before the first step."""
        return TrainState(parameters, parameters.zeros(), parameters.zeros())


@dataclass(frozen=True)
class DensificationStatistics:
    """Statistics of each row for densification, since the last reset.

    `views` [K] is the number of views that show a row, `gradient_norms` [K] the sum over them of the norm of
    dL/d(projected centre), in 3DGS's NDC units (an image is 2 wide and 2 high).
    """

    gradient_norms: Float32
    views: UInt32


class TrainableModel:
    """Gaussians that learn from photographs, one step at a time.

    Results are the same to the last bit from run to run and for any number of threads. `step_count` steps were taken
    before (Adam's bias correction). A model `beside` another one shares its device and queue, but not its buffers.
    """

    def __init__(
        self,
        state: TrainState,
        step_count: int = 0,
        device: Device | None = None,
        style: Style | None = None,
        beside: TrainableModel | None = None,
    ) -> None:
        self.step_count = step_count
        self.sh_degree = round(state.parameters.sh_coeffs.shape[1] ** 0.5) - 1
        self.sh_degree_active = self.sh_degree
        self.engine: Engine = beside.engine.beside() if beside else Engine((device or choose_device()).cl_device, style)
        self._photographs: list[Photograph] = []
        self.replace(state)

    @property
    def count(self) -> int:
        """Number of Gaussians."""
        return self._storage.count

    def set_targets(self, images: Sequence[Float32]) -> None:
        """Upload the photographs [H,W,3], values 0 to 1."""
        self._photographs = upload_photographs(self.engine, images)

    def step(
        self,
        camera: Camera,
        target: int,
        rates: LearningRates,
        *,
        background: Sequence[float] = (0.0, 0.0, 0.0),
        ssim_weight: float = SSIM_WEIGHT,
    ) -> float:
        """Render `camera`, compare with photograph number `target`, and move every parameter; return the loss.

        The photograph has the camera's size. The view counts in the statistics (statistics.cl).
        """
        loss, rendered, gradients = self.differentiate(camera, target, background, ssim_weight)
        self.engine.program("vector", "layout", "statistics").launch(
            "accumulate_statistics",
            self.count,
            self.count,
            camera.width / 2,
            camera.height / 2,
            rendered.projected.depth_keys,
            gradients.centres,
            *self.statistics_buffers,
            group=SUM_GROUP,
        )
        self.update(rates, gradients)
        return loss

    def differentiate(
        self, camera: Camera, target: int, background: Sequence[float], ssim_weight: float = SSIM_WEIGHT
    ) -> tuple[float, Rendered, DeviceGradients]:
        """Return the loss of a view, its frame and gradients; these stay valid until the next view."""
        rendered = self._forward(camera, background)
        loss, image_gradient = self._photographs[target].compare(rendered.canvas.image, ssim_weight)
        return loss, rendered, backward(rendered, image_gradient)

    def update(self, rates: LearningRates, gradients: DeviceGradients) -> None:
        """Move every parameter against its gradient."""
        self.step_count += 1
        self._adam.step(self.step_count, rates, gradients)

    def image(self, camera: Camera, background: Sequence[float] = (0.0, 0.0, 0.0)) -> Float32:
        """Return the image [H,W,3] of a view."""
        return self._forward(camera, background).image()

    def statistics(self) -> DensificationStatistics:
        """Read the statistics."""
        norms = np.empty(self.count, np.float32)
        views = np.empty(self.count, np.uint32)
        for values, buffer in zip((norms, views), self.statistics_buffers, strict=True):
            values[self._storage.order] = self.engine.read(buffer, (self.count,), values.dtype)
        return DensificationStatistics(norms, views)

    def state(self) -> TrainState:
        """Read parameters and moments."""
        read = partial(by_row, self.engine, self._storage)
        attributes = 3 * (self.sh_degree + 1) ** 2
        groups = zip(vars(self._adam.geometry).values(), vars(self._adam.channels).values(), strict=True)
        return TrainState(
            *(
                Parameters.split(read(geometry, GEOMETRY_ATTRIBUTES), read(channels, attributes))
                for geometry, channels in groups
            )
        )

    def replace(self, state: TrainState) -> None:
        """Continue from `state`, of any number of Gaussians, with statistics of zero."""
        engine = self.engine
        count = len(state.parameters)
        order = morton_order(state.parameters.means)

        def uploaded(*parts: Float32) -> Moments:
            return Moments(*(upload_attributes(engine, order, part.shape[1], part.__getitem__) for part in parts))

        parts = (state.parameters, state.first, state.second)
        geometry = uploaded(*(part.geometry for part in parts))
        channels = uploaded(*(part.channels for part in parts))
        activated = engine.allocate(4 * GEOMETRY_ATTRIBUTES * (count + BLOCK))
        self._storage = Storage.along(engine, order, activated)
        self._adam = Adam(engine, count, geometry, channels, 3 * (self.sh_degree + 1) ** 2, activated)
        self.statistics_buffers = (engine.allocate(4 * count), engine.allocate(4 * count))
        for buffer in self.statistics_buffers:
            engine.clear(buffer, 4 * count)

    def _forward(self, camera: Camera, background: Sequence[float]) -> Rendered:
        traversal = Traversal("ewa", channels=3, sh_degree=self.sh_degree_active, stored_sh_degree=self.sh_degree)
        return forward(Frame(self.engine, self._storage, camera, traversal, self._adam.channels.raw), background)


States = tuple[TrainState, TrainState]


class TwinModel:
    """Gaussians that learn two scenes: means, quaternions and scales from both, opacities and colours from one each.

    Results are the same to the last bit from run to run and for any number of threads. Both states have the same
    geometry, bit for bit. Its loss is that of the first scene plus `weight` times that of the second. The first of the
    two `models` has the statistics of the sum of both losses.
    """

    def __init__(self, states: States, weight: float, device: Device | None = None, style: Style | None = None) -> None:
        first = TrainableModel(states[0], 0, device, style)
        self.models = (first, TrainableModel(states[1], beside=first))
        self._weight = weight

    def set_targets(self, first: Sequence[Float32], second: Sequence[Float32]) -> None:
        """Upload the photographs [H,W,3] of both scenes, view by view."""
        for model, images in zip(self.models, (first, second), strict=True):
            model.set_targets(images)

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
        count = self.models[0].count
        shares_camera = np.array_equal(cameras[0].numbers, cameras[1].numbers)
        engine.program("vector", "layout", "statistics", "twins").launch(
            "share_gradients",
            engine.vectors(count),
            count,
            float(self._weight),
            int(shares_camera),
            *(size / 2 for camera in cameras for size in (camera.width, camera.height)),
            rendered.projected.depth_keys,
            second_rendered.projected.depth_keys,
            gradients.geometry,
            second_gradients.geometry,
            gradients.centres,
            second_gradients.centres,
            *self.models[0].statistics_buffers,
        )
        for model, (_, _, model_gradients) in zip(self.models, views, strict=True):
            model.update(rates, model_gradients)
        return loss + self._weight * second_loss

    def states(self) -> States:
        """Read parameters and moments."""
        return self.models[0].state(), self.models[1].state()

    def replace(self, states: States) -> None:
        """Continue from `states`, of any number of Gaussians, with statistics of zero."""
        for model, state in zip(self.models, states, strict=True):
            model.replace(state)
