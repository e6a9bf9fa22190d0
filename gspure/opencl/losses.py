"""The loss of 3DGS between an image on the device and a photograph, and its gradient (losses.cl)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from gspure.arrays import Float32
from gspure.constants import SSIM_SIGMA, SSIM_WINDOW
from gspure.opencl.device import Device, choose_device
from gspure.opencl.engine import Engine

_MARGIN = SSIM_WINDOW // 2
_BELL = np.exp(-0.5 * ((np.arange(SSIM_WINDOW) - _MARGIN) / SSIM_SIGMA) ** 2)  # a factor of SSIM's Gaussian window
SSIM_WEIGHT = 0.2  # share of 1 - SSIM in the loss; the rest is L1 (Kerbl et al. 2023)


class Planes:
    """Padded planes of images [H,W,C]: rows of `values` = W C floats behind a margin, `stride` floats apart.

    The margins stay zero: kernels write only between them.
    """

    def __init__(self, engine: Engine, height: int, width: int, channels: int) -> None:
        self.engine = engine
        self.shape = (height, width, channels)
        self.values = width * channels
        # A margin on each side, and room for whole vectors.
        self.stride = -(-(self.values + 2 * _MARGIN * channels + 16) // 16) * 16
        self.program = engine.program("vector", "losses", CHANNELS=channels)
        self.window = engine.uploaded(np.asarray(_BELL / _BELL.sum(), np.float32))
        self.image = engine.uploaded(self._zeros(1))
        self.moments = engine.uploaded(self._zeros(5))
        self.maps = engine.uploaded(self._zeros(3))

    def padded(self, image: Float32) -> cl.Buffer:
        """Upload `image` [H,W,C] as a plane."""
        height, _, channels = self.shape
        plane = self._zeros(1)
        first = _MARGIN * channels
        rows = plane[: height * self.stride].reshape(height, self.stride)
        rows[:, first : first + self.values] = image.reshape(height, -1)
        return self.engine.uploaded(plane)

    def _zeros(self, planes: int) -> Float32:
        """Return empty planes, and the 16 floats behind them that vector loads may touch."""
        return np.zeros(planes * self.shape[0] * self.stride + 16, np.float32)


@dataclass(frozen=True)
class Photograph:
    """A photograph on the device, as a padded plane."""

    planes: Planes
    plane: cl.Buffer

    def compare(self, image: cl.Buffer, ssim_weight: float) -> tuple[float, cl.Buffer]:
        """Return ((1 - w) L1 + w (1 - SSIM), dL/dimage [H,W,C]) of an image on the device, both means over all values.

        The gradient is valid until the next comparison on the same engine.
        """
        planes = self.planes
        target = self.plane
        weight = float(ssim_weight)
        engine = planes.engine
        window = planes.window
        padded = planes.image
        moments = planes.moments
        height = planes.shape[0]
        vectors = height * engine.vectors(planes.values)
        items = height if engine.style == "cpu" else vectors
        vector_losses = engine.buffers.vector_losses.sized(vectors)
        gradient = engine.buffers.image_gradient.sized(*planes.shape)

        def launch(kernel: str, *args: cl.Buffer | float) -> None:
            planes.program.launch(kernel, items, height, planes.values, planes.stride, *args)

        launch("pad_image", image, padded)
        launch("window_rows", window, padded, target, moments)
        launch("compare", weight, window, padded, target, moments, planes.maps, vector_losses)
        launch("window_maps", window, planes.maps, moments)  # the windowed maps replace the moments
        launch("loss_gradient", weight, window, padded, target, moments, gradient)
        losses = engine.read(vector_losses, (vectors,), np.float32)
        return float(losses.sum(dtype=np.float64)) / (height * planes.values), gradient


class Photographs:
    """Photographs [H,W,C], uploaded once, for images in host memory."""

    def __init__(self, images: Sequence[Float32], device: Device | None = None) -> None:
        self._engine = Engine((device or choose_device()).cl_device)
        self._photographs = upload_photographs(self._engine, images)

    def compare(self, number: int, image: Float32) -> tuple[float, Float32]:
        """Return the loss between `image` and a photograph, and its gradient [H,W,C]."""
        on_device = self._engine.buffers.image.holding(image)
        loss, gradient = self._photographs[number].compare(on_device, SSIM_WEIGHT)
        return loss, self._engine.read(gradient, image.shape, np.float32)


def upload_photographs(engine: Engine, images: Sequence[Float32]) -> list[Photograph]:
    """Upload photographs [H,W,C], values 0 to 1; photographs of one size share their planes."""
    planes = {shape: Planes(engine, *shape) for shape in {image.shape for image in images}}
    return [Photograph(planes[image.shape], planes[image.shape].padded(image)) for image in images]
