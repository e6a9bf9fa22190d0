"""A model that is being optimized: parameters, Adam's moments, photographs and statistics live on the device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.opencl.adam import LearningRates, Moments, activate, adam_step
from gspure.opencl.device import Device, choose_device
from gspure.opencl.engine import Engine, Style
from gspure.opencl.frame import Pass
from gspure.opencl.gradients import DeviceGradients, by_row
from gspure.opencl.losses import Plane, image_loss, padded_target
from gspure.opencl.morton import morton_order
from gspure.opencl.passes import ENTRY_BUDGET, Rendered, backward, forward
from gspure.opencl.storage import BLOCK, GEOMETRY_ATTRIBUTES, Storage, upload_attributes

Float32 = NDArray[np.float32]
SSIM_WEIGHT = 0.2
"""Share of 1 - SSIM in the loss; the rest is L1 (Kerbl et al. 2023)."""


@dataclass(frozen=True)
class Parameters:
    """Raw parameters by row, as a 3DGS PLY stores them; or anything of the same shape, such as Adam's moments."""

    means: Float32
    quats: Float32
    log_scales: Float32
    opacity_logits: Float32
    sh_coeffs: Float32

    def __len__(self) -> int:
        return len(self.means)

    @property
    def geometry(self) -> Float32:
        """[K,11]: all but the colours."""
        return np.concatenate([self.means, self.quats, self.log_scales, self.opacity_logits[:, None]], axis=1)

    @property
    def channels(self) -> Float32:
        """[K,3 S]: the colours."""
        return self.sh_coeffs.reshape(len(self), 3 * self.sh_coeffs.shape[1])

    @staticmethod
    def of(geometry: Float32, sh_coeffs: Float32) -> Parameters:
        """Take `geometry` [K,11] and `sh_coeffs` [K,3 S] apart."""
        means, quats, log_scales, logits = (
            np.ascontiguousarray(part) for part in np.split(geometry, [3, 7, 10], axis=1)
        )
        return Parameters(means, quats, log_scales, logits[:, 0], sh_coeffs.reshape(-1, sh_coeffs.shape[1] // 3, 3))

    def rows(self, rows: NDArray[Any]) -> Parameters:
        """Return these rows: indices, or a mask."""
        return Parameters(*(getattr(self, field.name)[rows] for field in fields(self)))

    def zeros(self) -> Parameters:
        """Return zeros of the same shapes."""
        return Parameters(*(np.zeros_like(getattr(self, field.name)) for field in fields(self)))


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
class Statistics:
    """What densification looks at, by row, since the last reset.

    Parameters
    ----------
    gradient_norms : array [K]
        Sum over the views that show a Gaussian of the norm of dL/d(projected centre), in 3DGS's NDC units (an image is
        2 wide and 2 high).
    views : array [K]
        Number of those views.

    """

    gradient_norms: Float32
    views: NDArray[np.uint32]


class TrainableModel:
    """Gaussians that learn from photographs, one step at a time.

    Results are the same to the last bit from run to run and for any number of threads.

    Parameters
    ----------
    state : TrainState
        Where to begin.
    step_count : int
        Steps already taken (Adam's bias correction).
    device : Device, optional
    style : "cpu" or "gpu", optional
    beside : TrainableModel, optional
        Work on its device and in its queue, with buffers of one's own.

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
        self._targets: list[tuple[Plane, object]] = []
        self.replace(state)

    @property
    def count(self) -> int:
        """Number of Gaussians."""
        return self._storage.count

    def set_targets(self, images: Sequence[Float32]) -> None:
        """Upload the photographs [H,W,3], values 0 to 1."""
        self._targets = [(Plane(*image.shape), self.engine.uploaded(padded_target(image))) for image in images]

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

        Raises
        ------
        ValueError
            If the photograph is not of the camera's size.

        """
        loss, seen, gradients = self.differentiate(camera, target, background, ssim_weight)
        self._note(seen, gradients)
        self.update(rates, gradients)
        return loss

    def differentiate(
        self,
        camera: Camera,
        target: int,
        background: Sequence[float] = (0.0, 0.0, 0.0),
        ssim_weight: float = SSIM_WEIGHT,
    ) -> tuple[float, Rendered, DeviceGradients]:
        """Return the loss of a view, its frame and gradients; these stay valid until the next view."""
        plane, photograph = self._targets[target]
        if (plane.width, plane.height) != (camera.width, camera.height):
            raise ValueError(
                f"a photograph of {plane.width}x{plane.height} for a view of {camera.width}x{camera.height}"
            )
        seen = self._forward(camera, background)
        loss, image_gradient = image_loss(self.engine, plane, seen.canvas.image, photograph, ssim_weight)
        return loss, seen, backward(self.engine, self._storage, seen, image_gradient)

    def update(self, rates: LearningRates, gradients: DeviceGradients) -> None:
        """Move every parameter against its gradient."""
        self.step_count += 1
        adam_step(
            *(self.engine, self.count, self.step_count, rates, gradients),
            *(self._geometry, self._storage.geometry, self._sh_coeffs, 3 * (self.sh_degree + 1) ** 2),
        )

    def image(self, camera: Camera, background: Sequence[float] = (0.0, 0.0, 0.0)) -> Float32:
        """Return the image [H,W,3] of a view."""
        canvas = self._forward(camera, background).canvas
        return self.engine.read(canvas.image, (camera.height, camera.width, 3), np.float32)

    @property
    def statistics_buffers(self) -> tuple[object, object]:
        """The statistics on the device, by storage position."""
        return self._norms, self._views

    def statistics(self) -> Statistics:
        """Read the statistics."""
        order, count = self._storage.order, self.count
        norms, views = np.empty(count, np.float32), np.empty(count, np.uint32)
        norms[order] = self.engine.read(self._norms, (count,), np.float32)
        views[order] = self.engine.read(self._views, (count,), np.uint32)
        return Statistics(norms, views)

    def reset_statistics(self) -> None:
        """Begin the statistics anew."""
        for buffer in (self._norms, self._views):
            self.engine.clear(buffer, 4 * self.count)

    def state(self) -> TrainState:
        """Read parameters and moments."""
        attributes = 3 * (self.sh_degree + 1) ** 2
        return TrainState(
            *(
                Parameters.of(
                    by_row(self.engine, self._storage, getattr(self._geometry, part), GEOMETRY_ATTRIBUTES),
                    by_row(self.engine, self._storage, getattr(self._sh_coeffs, part), attributes),
                )
                for part in ("raw", "first", "second")
            )
        )

    def replace(self, state: TrainState) -> None:
        """Go on from `state`, of any number of Gaussians; the statistics begin anew."""
        engine, parameters, count = self.engine, state.parameters, len(state.parameters)
        order = morton_order(parameters.means)

        def uploaded(raw: Float32, first: Float32, second: Float32) -> Moments:
            return Moments(
                *(upload_attributes(engine, order, raw.shape[1], part.__getitem__) for part in (raw, first, second))
            )

        parts = (parameters, state.first, state.second)
        self._geometry = uploaded(*(part.geometry for part in parts))
        self._sh_coeffs = uploaded(*(part.channels for part in parts))
        activated = engine.allocate(4 * GEOMETRY_ATTRIBUTES * (count + BLOCK))
        self._storage = Storage.along(engine, order, activated)
        if count:
            activate(engine, count, self._geometry.raw, activated)
        self._norms, self._views = engine.allocate(4 * count), engine.allocate(4 * count)
        self.reset_statistics()

    def _note(self, seen: Rendered, gradients: DeviceGradients) -> None:
        """Add a view to the statistics."""
        if self.count:
            kernel = self.engine.kernel(
                "accumulate_statistics", *("vector", "layout", "adam"), CHANNEL_ATTRIBUTES=0, RAY=0, CHANNELS=0
            )
            self.engine.run(
                kernel,
                self.count,
                *(np.uint32(self.count), np.float32(seen.camera.width / 2), np.float32(seen.camera.height / 2)),
                *(seen.projected.depth_keys, gradients.centres, self._norms, self._views),
                group=64,
            )

    def _forward(self, camera: Camera, background: Sequence[float]) -> Rendered:
        frame = Pass("ewa", channels=3, sh_degree=self.sh_degree_active, stored_sh_degree=self.sh_degree)
        return forward(
            *(self.engine, self._storage, frame, camera),
            channels=self._sh_coeffs.raw,
            background=background,
            entry_budget=ENTRY_BUDGET,
        )
