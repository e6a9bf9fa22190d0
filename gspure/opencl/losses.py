"""The loss of 3DGS between an image on the device and a photograph, and its gradient (losses.cl)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.constants import SSIM_SIGMA, SSIM_WINDOW
from gspure.opencl.engine import LANES, Engine

_MARGIN = SSIM_WINDOW // 2


@dataclass(frozen=True)
class Plane:
    """Padded rows of one image size: `values` = width * channels floats behind a margin, `stride` floats apart."""

    height: int
    width: int
    channels: int

    @property
    def values(self) -> int:
        """Floats of a row that belong to pixels."""
        return self.width * self.channels

    @property
    def stride(self) -> int:
        """Floats from row to row: a margin on either side, and room for whole vectors."""
        return -(-(self.values + 2 * _MARGIN * self.channels + 16) // 16) * 16

    @property
    def nbytes(self) -> int:
        """Bytes of a plane, and of the margin that loads may touch behind it."""
        return 4 * (self.height * self.stride + 16)

    @property
    def shape(self) -> tuple[np.uint32, np.uint32, np.uint32]:
        """(height, values, stride), as the kernels take them."""
        return np.uint32(self.height), np.uint32(self.values), np.uint32(self.stride)


def ssim_window() -> NDArray[np.float32]:
    """Return the 1-D factor of SSIM's 11 x 11 Gaussian window, sigma 1.5, normalized."""
    offsets = np.arange(SSIM_WINDOW) - _MARGIN
    window = np.exp(-0.5 * (offsets / SSIM_SIGMA) ** 2)
    return np.asarray(window / window.sum(), np.float32)


def padded_target(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return a photograph [H,W,C] as the padded rows that `image_loss` takes."""
    height, width, channels = image.shape
    plane = Plane(height, width, channels)
    rows = np.zeros(plane.nbytes // 4, np.float32)
    first = _MARGIN * channels
    rows[: height * plane.stride].reshape(height, plane.stride)[:, first : first + plane.values] = image.reshape(
        height, -1
    )
    return rows


def image_loss(
    engine: Engine, plane: Plane, image: cl.Buffer, target: cl.Buffer, ssim_weight: float
) -> tuple[float, cl.Buffer]:
    """Return ((1 - w) L1 + w (1 - SSIM), dL/dimage [H,W,C] on the device), both means over all values."""
    items = plane.height * -(-plane.values // LANES[engine.style])
    weight = np.float32(ssim_weight)
    window = engine.upload("ssim_window", ssim_window())
    padded = _cleared(engine, "padded_image", plane, 1)
    moments = _cleared(engine, "ssim_moments", plane, 5)
    maps = _cleared(engine, "ssim_maps", plane, 3)
    item_losses = engine.buffer("item_losses", 4 * items)
    gradient = engine.buffer("image_gradient", 4 * plane.height * plane.values)

    def run(name: str, *args: object) -> None:
        kernel = engine.kernel(name, "vector", "losses", CHANNELS=plane.channels)
        engine.run(kernel, items, *plane.shape, *args)

    run("pad_image", image, padded)
    run("window_rows", window, padded, target, moments)
    run("compare", weight, window, padded, target, moments, maps, item_losses)
    run("window_maps", window, maps, moments)  # the moments are done with; their room holds the windowed maps
    run("loss_gradient", weight, window, padded, target, moments, gradient)
    losses = engine.read(item_losses, (items,), np.float32)
    return float(losses.sum(dtype=np.float64)) / (plane.height * plane.values), gradient


def _cleared(engine: Engine, name: str, plane: Plane, planes: int) -> cl.Buffer:
    """Return room for planes whose margins are zero: they stay so, since kernels write inside them only."""
    nbytes = planes * 4 * plane.height * plane.stride + 64
    name = f"{name}_{plane.height}x{plane.width}x{plane.channels}"
    fresh = not engine.has(name)
    buffer = engine.buffer(name, nbytes)
    if fresh:
        engine.clear(buffer, nbytes)
    return buffer
