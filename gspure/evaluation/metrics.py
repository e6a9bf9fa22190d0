"""Metrics of two images [H,W,C] in 0 .. 1, computed as by 3DGS; images of different shapes are refused.

To add a metric: a function, and a line in `METRICS`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gspure.constants import SSIM_C1, SSIM_C2, SSIM_SIGMA, SSIM_WINDOW
from gspure.errors import InputError

Float64 = NDArray[np.float64]


def psnr(a: NDArray[Any], b: NDArray[Any]) -> float:
    r"""Return the peak signal-to-noise ratio in dB.

    .. math:: -10 \log_{10} \mathrm{MSE}

    with the mean over all pixels and channels (not a mean of three channels' PSNRs); infinite for equal images.
    """
    _check_same_shape(a, b)
    error = float(np.mean(np.square(np.subtract(a, b, dtype=np.float64))))
    return -10.0 * float(np.log10(error)) if error else float("inf")


def ssim(a: NDArray[Any], b: NDArray[Any]) -> float:
    r"""Return the structural similarity index, mean over pixels and channels.

    .. math::
        \mathrm{SSIM} = \frac{(2 \mu_a \mu_b + C_1)(2 \sigma_{ab} + C_2)}
        {(\mu_a^2 + \mu_b^2 + C_1)(\sigma_a^2 + \sigma_b^2 + C_2)}

    (Wang et al. 2004) in the form of 3DGS: a Gaussian window of 11 x 11 with σ = 1.5, population covariances, and
    zeros beyond the border. scikit-image's defaults differ in all three.
    """
    _check_same_shape(a, b)
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    mean_a, mean_b = _blur(a), _blur(b)
    var_a, var_b = _blur(a * a) - mean_a**2, _blur(b * b) - mean_b**2
    covariance = _blur(a * b) - mean_a * mean_b
    luminance = (2 * mean_a * mean_b + SSIM_C1) / (mean_a**2 + mean_b**2 + SSIM_C1)
    structure = (2 * covariance + SSIM_C2) / (var_a + var_b + SSIM_C2)
    return float(np.mean(luminance * structure))


def gradient_correlation(a: NDArray[Any], b: NDArray[Any]) -> float:
    r"""Return the normalized correlation of two images' gradients, -1 to 1.

    .. math:: \frac{\sum \nabla a \cdot \nabla b}{\sqrt{\sum |\nabla a|^2 \sum |\nabla b|^2}}

    over pixels, channels and both directions (forward differences); 0 if either image is flat. Brightness and contrast
    do not count, only structure: a faded or tinted message correlates as well as a faithful one.
    """
    _check_same_shape(a, b)
    first, second = (_gradients(np.asarray(image, np.float64)) for image in (a, b))
    norm = float(np.sqrt(np.sum(first**2) * np.sum(second**2)))
    return float(np.sum(first * second)) / norm if norm else 0.0


def rms_ratio(message: ArrayLike, scene: ArrayLike) -> float:
    r"""Return the root-mean-square damage to the message, relative to that of the scene.

    .. math:: \sqrt{\frac{\sum \Delta \mathrm{MSE}_{message}}{\sum \Delta \mathrm{MSE}_{scene}}}, \quad
        \mathrm{MSE} = 10^{-\mathrm{PSNR} / 10}

    0 if the message loses nothing, NaN if the scene loses nothing.

    `message` and `scene` [N,2] are PSNR before and after an attack in the same N scenes, dB.
    """
    rises = [float(np.sum(np.diff(10.0 ** (-np.asarray(psnr) / 10)))) for psnr in (message, scene)]
    return float(np.sqrt(max(rises[0], 0.0) / rises[1])) if rises[1] > 0 else math.nan


def _gradients(image: Float64) -> Float64:
    """Return the forward differences of an image [H,W,C] down and across, as one flat array."""
    return np.concatenate([np.diff(image, axis=axis).ravel() for axis in (0, 1)])


def _check_same_shape(a: NDArray[Any], b: NDArray[Any]) -> None:
    if np.shape(a) != np.shape(b):
        raise InputError("images", "shape", expected=f"{list(np.shape(a))}", found=f"{list(np.shape(b))}")


def gaussian_window() -> Float64:
    """Return the window [11] whose outer product with itself weighs a neighbourhood; its sum is 1."""
    offsets = np.arange(SSIM_WINDOW) - SSIM_WINDOW // 2
    window = np.exp(-(offsets**2) / (2 * SSIM_SIGMA**2))
    return np.asarray(window / window.sum())


class Metric(NamedTuple):
    """An image metric, and the format of its values."""

    compute: Callable[[NDArray[Any], NDArray[Any]], float]
    """Of a reference and another image [H,W,3] in 0 .. 1."""

    title: str
    decimals: int
    """In tables."""

    stored: str
    """Format in ``metrics.csv``."""

    def text(self, value: float) -> str:
        """Return the text of a value in tables: ∞ for identical images, – if it is unknown."""
        return "–" if np.isnan(value) else "∞" if np.isinf(value) else f"{value:.{self.decimals}f}"


METRICS: Final[Mapping[str, Metric]] = {
    "psnr": Metric(psnr, "PSNR", 2, ".6f"),
    "ssim": Metric(ssim, "SSIM", 3, ".8f"),
    "structure": Metric(gradient_correlation, "GC", 3, ".8f"),
}


def _blur(image: Float64) -> Float64:
    from scipy.ndimage import correlate1d

    window = gaussian_window()
    rows = correlate1d(image, window, axis=0, mode="constant")
    return np.asarray(correlate1d(rows, window, axis=1, mode="constant"))
