"""The loss of 3DGS, (1 - w) L1 + w (1 - SSIM), and its gradient with respect to the image."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float64
from gspure.constants import SSIM_C1, SSIM_C2, SSIM_SIGMA, SSIM_WINDOW


def image_loss(image: NDArray[Any], target: NDArray[Any], ssim_weight: float) -> tuple[float, Float64]:
    """Return (loss, dL/dimage [H,W,C]) of an image and a photograph [H,W,C]; L1 and SSIM are means over all values.

    SSIM is that of Wang et al. 2004 with a Gaussian window of 11 x 11, population covariances and zeros beyond the
    border, as in 3DGS. L1 has no gradient where the two are equal.
    """
    x, y = np.asarray(image, np.float64), np.asarray(target, np.float64)
    similarity, by_x = ssim_map(x, y)
    loss = (1 - ssim_weight) * np.abs(x - y) + ssim_weight * (1 - similarity)
    gradient = (1 - ssim_weight) * np.sign(x - y) - ssim_weight * by_x
    return float(loss.mean()), gradient / x.size


def ssim_map(x: Float64, y: Float64) -> tuple[Float64, Float64]:
    """Return SSIM at each value [H,W,C], and the gradient of its sum with respect to `x`.

    The window is linear and symmetric, hence its own adjoint: gradients of windowed moments are windowed in turn.
    """
    mean_x, mean_y, square_x, square_y, product = (windowed(plane) for plane in (x, y, x * x, y * y, x * y))
    luminance, contrast = 2 * mean_x * mean_y + SSIM_C1, 2 * (product - mean_x * mean_y) + SSIM_C2
    brightness = mean_x**2 + mean_y**2 + SSIM_C1
    variance = square_x - mean_x**2 + square_y - mean_y**2 + SSIM_C2
    similarity = luminance * contrast / (brightness * variance)
    by_luminance, by_product = contrast / (brightness * variance), 2 * luminance / (brightness * variance)
    by_brightness, by_square = -similarity / brightness, -similarity / variance
    by_mean = 2 * mean_y * by_luminance + 2 * mean_x * by_brightness
    by_mean -= mean_y * by_product + 2 * mean_x * by_square  # both (co)variances subtract products of means
    return similarity, windowed(by_mean) + 2 * x * windowed(by_square) + y * windowed(by_product)


def windowed(planes: Float64) -> Float64:
    """Return the Gaussian-weighted means [H,W,C] around each pixel, with zeros beyond the border."""
    height, width = planes.shape[:2]
    return np.asarray(np.einsum("ij,jkc,kl->ilc", band_matrix(height), planes, band_matrix(width), optimize=True))


def band_matrix(size: int) -> Float64:
    """Return the matrix [size,size] of the window along one axis: weight of pixel j in the mean around pixel i."""
    offsets = np.arange(SSIM_WINDOW) - SSIM_WINDOW // 2
    weights = np.exp(-0.5 * (offsets / SSIM_SIGMA) ** 2)
    distances = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    matrix = np.exp(-0.5 * (distances / SSIM_SIGMA) ** 2) / weights.sum()
    return np.asarray(np.where(distances <= SSIM_WINDOW // 2, matrix, 0.0))
