"""The photographs of a branch on the device, and the loss of 3DGS with its gradient."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gspure.opencl.device import Device
from gspure.opencl.engine import Engine
from gspure.opencl.losses import upload_photographs
from gspure.opencl.trainable import SSIM_WEIGHT

Float32 = NDArray[np.float32]


class Photographs:
    """Photographs [H,W,3] of the training views, uploaded once."""

    def __init__(self, images: Sequence[Float32], device: Device) -> None:
        self._engine = Engine(device.cl_device)
        self._photographs = upload_photographs(self._engine, images)

    def compare(self, number: int, image: Float32) -> tuple[float, Float32]:
        """Return 0.8 L1 + 0.2 (1 - SSIM) between `image` and a photograph, and its gradient [H,W,3]."""
        on_device = self._engine.buffers.image.holding(image)
        loss, gradient = self._photographs[number].compare(on_device, SSIM_WEIGHT)
        return loss, self._engine.read(gradient, image.shape, np.float32)
