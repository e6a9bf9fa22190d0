"""The loss of 3DGS in PyTorch, equal to that of `gspure.opencl.losses`."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from gspure.constants import SSIM_C1, SSIM_C2, SSIM_WINDOW
from gspure.opencl.losses import ssim_window
from gspure.opencl.trainable import SSIM_WEIGHT
from gspure.training.pytorch import torch

Float32 = NDArray[np.float32]


def photometric(image: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """Return 0.8 L1 + 0.2 (1 - SSIM) of images [H,W,3], both means over all values."""
    l1 = (image - target).abs().mean()
    return (1 - SSIM_WEIGHT) * l1 + SSIM_WEIGHT * (1 - ssim(image, target))


def differentiated(
    decoder: torch.nn.Module, feature_map: Float32, image: Float32, weight: float = 1.0
) -> tuple[float, Float32]:
    """Return the weighted loss of a decoder's image, and its gradient with respect to the feature map."""
    features = torch.from_numpy(feature_map).requires_grad_()
    loss = weight * photometric(decoder(features), torch.from_numpy(image))
    decoder.zero_grad()
    loss.backward()
    gradient: Float32 = features.grad.numpy()
    return loss.item(), gradient


def ssim(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """Return the structural similarity of images [H,W,3] (`gspure.evaluation.metrics.ssim`)."""
    a, b = a.permute(2, 0, 1), b.permute(2, 0, 1)
    mean_a, mean_b, square_a, square_b, product = _windowed(torch.stack([a, b, a * a, b * b, a * b]))
    var_a, var_b, covariance = square_a - mean_a**2, square_b - mean_b**2, product - mean_a * mean_b
    luminance = (2 * mean_a * mean_b + SSIM_C1) / (mean_a**2 + mean_b**2 + SSIM_C1)
    return (luminance * (2 * covariance + SSIM_C2) / (var_a + var_b + SSIM_C2)).mean()


def _windowed(planes: torch.Tensor) -> torch.Tensor:
    """Return planes [N,3,H,W] filtered by SSIM's window, with zeros outside the image."""
    height, width = planes.shape[2:]
    return _window(height) @ planes @ _window(width)


@cache
def _window(size: int) -> torch.Tensor:
    """Return the symmetric matrix that filters a line of pixels, many times faster than PyTorch's convolution."""
    margin = SSIM_WINDOW // 2
    shifts = (np.eye(size, k=offset, dtype=np.float32) for offset in range(-margin, margin + 1))
    return torch.from_numpy(sum(weight * shift for weight, shift in zip(ssim_window(), shifts, strict=True)))
