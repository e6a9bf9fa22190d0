"""Metrics of two images [H,W,C] in 0 .. 1, computed as by 3DGS; images of different shapes are refused.

To add a metric: a function, and a line in `METRICS`, from which tables get their columns and notes.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float64
from gspure.constants import MS_SSIM_WEIGHTS, SSIM_C1, SSIM_C2, SSIM_SIGMA, SSIM_WINDOW
from gspure.errors import InputError
from gspure.text import decimal

DAMAGE_TOLERANCE: Final = 0.04  # dB: the size of the smallest differences shown
_STRIP: Final = 1 << 20  # values processed at once: a large image takes little memory beside itself
_ROWS: Final = 16  # rows blurred at a time: they fit into the cache of a core


def psnr(a: NDArray[Any], b: NDArray[Any]) -> float:
    r"""Return the peak signal-to-noise ratio in dB.

    .. math:: -10 \log_{10} \mathrm{MSE}

    with the mean over all pixels and channels (not a mean of three channels' PSNRs); infinite for equal images.

    >>> round(gspure.psnr(np.zeros((4, 4, 3)), np.full((4, 4, 3), 0.1)), 6)
    20.0
    """
    _check_same_shape(a, b)
    return _decibels(sum(float(np.sum(np.square(x - y))) for x, y in _strips(a, b)), a.size)


def ssim(a: NDArray[Any], b: NDArray[Any]) -> float:
    r"""Return the structural similarity index, mean over pixels and channels.

    .. math::
        \mathrm{SSIM} = \frac{(2 \mu_a \mu_b + C_1)(2 \sigma_{ab} + C_2)}
        {(\mu_a^2 + \mu_b^2 + C_1)(\sigma_a^2 + \sigma_b^2 + C_2)}

    (Wang et al. 2004) in the form of 3DGS: a Gaussian window of 11 x 11 with σ = 1.5, population covariances, and
    zeros beyond the border.

    >>> image = np.random.default_rng(0).random((32, 32, 3))
    >>> round(gspure.ssim(image, image), 6), round(gspure.ssim(image, 1 - image), 2) < 0
    (1.0, True)
    """
    _check_same_shape(a, b)
    return float(np.mean(_mean_similarities(a, b)[0]))


def ms_ssim(a: NDArray[Any], b: NDArray[Any]) -> float:
    r"""Return the multi-scale structural similarity index, 0 to 1.

    .. math:: \prod_{j<M} \max(0, \overline{cs}_j)^{w_j} \cdot \max(0, \overline{l_M cs_M})^{w_M}

    (Wang, Simoncelli and Bovik 2003), mean over channels, with luminance l and contrast and structure cs averaged over
    the pixels whose window lies in the image. Each scale averages 2 x 2 pixels of the previous one. The shorter side
    limits the number M of scales, at least 1; the first M of `MS_SSIM_WEIGHTS` are divided by their sum.
    """
    return ssims(a, b)[1]


def ssims(a: NDArray[Any], b: NDArray[Any]) -> tuple[float, float]:
    """Return `ssim` and `ms_ssim`, which share the similarities at full size."""
    _check_same_shape(a, b)
    if np.array_equal(a, b):
        return 1.0, 1.0
    scales = int(np.log2(max(min(a.shape[:2]) / SSIM_WINDOW, 1.0))) + 1
    weights = MS_SSIM_WEIGHTS[:scales]
    index = np.ones(a.shape[2])
    for scale, weight in enumerate(weights, start=1):
        if scale > 1:
            a = halved(a)
            b = halved(b)
        everywhere, whole, contrast = _mean_similarities(a, b)
        if scale == 1:
            single = float(np.mean(everywhere))
        similarity = whole if scale == len(weights) else contrast
        index *= np.maximum(0.0, similarity) ** (weight / sum(weights))
    return single, float(np.mean(index))


def _decibels(squares: float, count: int) -> float:
    return -10.0 * float(np.log10(squares / count)) if squares else math.inf


def _strips(*images: NDArray[Any]) -> Iterator[list[NDArray[Any]]]:
    """Yield the same rows of images as float64, and of masks, strip by strip."""
    for rows in _rows_of_strips(images[0]):
        yield [image[rows] if image.dtype == np.bool_ else np.asarray(image[rows], np.float64) for image in images]


def _rows_of_strips(image: NDArray[Any]) -> Iterator[slice]:
    step = max(1, _STRIP // image[0].size)
    return (slice(start, min(start + step, len(image))) for start in range(0, len(image), step))


def _mean_similarities(a: NDArray[Any], b: NDArray[Any]) -> tuple[Float64, Float64, Float64]:
    """Return three means [C]: of SSIM over all pixels, of SSIM inside, and of contrast and structure inside.

    Inside are the pixels whose window lies in the image; along a side shorter than the window, all pixels.
    """
    reach = SSIM_WINDOW // 2
    height, width = a.shape[:2]
    top, left = (reach if side >= SSIM_WINDOW else 0 for side in (height, width))
    bottom = height - top
    right = width - left
    total = np.zeros((3, a.shape[2]))
    for rows in _rows_of_strips(a):
        first = max(rows.start - reach, 0)
        block = slice(first, rows.stop + reach)  # the strip, and the rows that its windows reach
        luminance, contrast = _similarity(np.asarray(a[block], np.float64), np.asarray(b[block], np.float64))
        similarity = luminance * contrast
        strip = slice(rows.start - first, rows.stop - first)
        inside = (slice(max(rows.start, top) - first, min(rows.stop, bottom) - first), slice(left, right))
        total += [np.sum(terms, axis=(0, 1)) for terms in (similarity[strip], similarity[inside], contrast[inside])]
    area = height * width
    area_inside = (bottom - top) * (right - left)
    return total[0] / area, total[1] / area_inside, total[2] / area_inside


def _similarity(a: Float64, b: Float64) -> tuple[Float64, Float64]:
    """Return the two factors of SSIM of every pixel and channel: luminance, and contrast with structure."""
    mean_a = _blur(a)
    mean_b = _blur(b)
    square_a = mean_a**2
    square_b = mean_b**2
    product = mean_a * mean_b
    var_a = _blur(a * a) - square_a
    var_b = _blur(b * b) - square_b
    covariance = _blur(a * b) - product
    luminance = (2 * product + SSIM_C1) / (square_a + square_b + SSIM_C1)
    return luminance, (2 * covariance + SSIM_C2) / (var_a + var_b + SSIM_C2)


def _blur(image: Float64) -> Float64:
    """Return the mean under a Gaussian window around each pixel.

    The terms are summed in the order of `scipy.ndimage`, whose import is slow.
    """
    reach = SSIM_WINDOW // 2
    window = np.exp(-((np.arange(SSIM_WINDOW) - reach) ** 2) / (2 * SSIM_SIGMA**2))
    window /= window.sum()
    padded = np.pad(image, [(reach, reach), (0, 0), (0, 0)])
    width = image.shape[1]
    blurred = np.empty_like(image)
    spare = np.empty_like(image[:_ROWS])
    wide = np.pad(spare, [(0, 0), (reach, reach), (0, 0)])
    for first in range(0, len(image), _ROWS):
        block = blurred[first : first + _ROWS]
        rows = len(block)
        above = [padded[start : start + rows] for start in range(first, first + SSIM_WINDOW)]
        _add_under(window, above, wide[:rows, reach : reach + width], spare[:rows])
        beside = [wide[:rows, start : start + width] for start in range(SSIM_WINDOW)]
        _add_under(window, beside, block, spare[:rows])
    return blurred


def _add_under(window: Float64, shifted: Sequence[Float64], total: Float64, spare: Float64) -> None:
    """Write the sum of `shifted` arrays, each times its entry of a symmetric window, to `total`."""
    reach = len(window) // 2
    np.multiply(shifted[reach], window[reach], out=total)
    for low in range(reach):
        np.add(shifted[low], shifted[-1 - low], out=spare)
        spare *= window[low]
        total += spare


def halved(image: NDArray[Any]) -> Float64:
    """Return the means of 2 x 2 pixels, without an odd last row or column."""
    height, width = (side // 2 for side in image.shape[:2])
    squares = image[: 2 * height, : 2 * width].reshape(height, 2, width, 2, -1)
    return np.asarray(squares.mean(axis=(1, 3), dtype=np.float64))


def _check_same_shape(a: NDArray[Any], b: NDArray[Any]) -> None:
    if np.shape(a) != np.shape(b):
        raise InputError("images", "shape", expected=f"{list(np.shape(a))}", found=f"{list(np.shape(b))}")


class Metric(NamedTuple):
    """An image metric, and how tables print it."""

    compute: Callable[[NDArray[Any], NDArray[Any]], float]  # of a reference and another image [H,W,3] in 0 .. 1
    title: str
    decimals: int  # in tables

    def text(self, value: float) -> str:
        """Return the text of a value in tables: ∞ for identical images, – if it is unknown."""
        return decimal(value, self.decimals)


def measured(a: NDArray[Any], b: NDArray[Any]) -> dict[str, float]:
    """Return all `METRICS` of a reference and another image."""
    computed = dict(zip(("ssim", "ms_ssim"), ssims(a, b), strict=True))
    return {name: computed[name] if name in computed else metric.compute(a, b) for name, metric in METRICS.items()}


METRICS: Final[Mapping[str, Metric]] = {
    "psnr": Metric(psnr, "PSNR", 2),
    "ssim": Metric(ssim, "SSIM", 3),
    "ms_ssim": Metric(ms_ssim, "MS-SSIM", 3),
}
