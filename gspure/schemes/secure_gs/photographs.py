"""The photographs of a branch on the device, and the loss of 3DGS with its gradient."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gspure.opencl.device import Device
from gspure.opencl.engine import Engine
from gspure.opencl.losses import Plane, image_loss, padded_target
from gspure.opencl.trainable import SSIM_WEIGHT

Float32 = NDArray[np.float32]


class Photographs:
    """Photographs [H,W,3] of the training views, uploaded once."""

    def __init__(self, images: Sequence[Float32], device: Device) -> None:
        self._engine = Engine(device.cl_device)
        self._targets = [(Plane(*image.shape), self._engine.uploaded(padded_target(image))) for image in images]

    def compare(self, number: int, image: Float32) -> tuple[float, Float32]:
        """Return 0.8 L1 + 0.2 (1 - SSIM) between `image` and a photograph, and its gradient [H,W,3]."""
        plane, target = self._targets[number]
        uploaded = self._engine.upload("image", image)
        loss, gradient = image_loss(self._engine, plane, uploaded, target, SSIM_WEIGHT)
        return loss, self._engine.read(gradient, image.shape, np.float32)
