r"""What a suspect shows of any pattern: one number per cell and channel, before a key is used.

*Blind*: the mean colour of the rows of each cell, against the cells around it. *Informed*: the difference r of the
suspect's renders from those R of a reference, such as the owner's clean model, pulled back to colours c of the clean
model. Since a pattern s is constant in every cell,

.. math:: \langle r, \tfrac{\partial R}{\partial c}\, s \rangle
          = \sum_{cells} s_{cell} \sum_{k \in cell} (\tfrac{\partial R}{\partial c_k})^T r,

so one backward pass per view gives the statistic of every key.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, Float64, Indices
from gspure.cameras.camera import Camera
from gspure.constants import SH_DC
from gspure.model.gaussians import LEAST_OPACITY, Gaussians
from gspure.opencl.device import Device
from gspure.renderer import Renderer
from gspure.schemes.keyed_pattern.pattern import Cells, Grid, recoloured

AROUND: Final = 16  # cells around a cell; ours
LEAST_AREA: Final = 1e-6  # relative to the median row's: every cell has a colour
LARGEST_AREA: Final = 10.0  # of a row that counts, relative to the median row's; ours
LARGEST_WEIGHT: Final = 4.0  # of a cell that counts, relative to the median cell's; ours
DEVIATIONS: Final = 4.0  # largest residual of a cell, in deviations of those around it; ours
LARGEST_MARK: Final = 0.01  # residual of a cell (of 1) that may be a mark; ours
OUTLIER: Final = 0.12  # difference of a pixel from which on it shows something else, such as a hole; ours
NOISE: Final = 0.004  # least deviation of a pixel: rounding to 8 bits; ours
WINDOW: Final = 9  # side in pixels of the square that measures the deviation; ours
REWEIGHTINGS: Final = 3  # of a colour map; ours
TOLERANCE: Final = 0.03  # difference of a pixel at which it counts half in a colour map; ours


class CellColours(NamedTuple):
    """The colours of the cells of a model, weighted by the opacity and area of rows."""

    cells: Cells  # [C], ascending
    places: Indices  # [K], the cell of each row
    residuals: Float64  # [C,3], the mean colour (0 to 1) of the rows, less the median of the cells around
    neighbours: Indices  # [C,A], the cells around each
    weights: Float64  # [C]


def cell_colours(model: Gaussians, grid: Grid) -> CellColours:
    """Return the colours of the cells that rows lie in."""
    from scipy.spatial import KDTree

    cells, places = np.unique(grid.cells(model), return_inverse=True)
    scales = np.sort(model.scales.astype(np.float64), axis=1)
    areas = scales[:, 1] * scales[:, 2]
    typical = np.median(areas) if len(areas) else 1.0
    sizes = np.clip(areas / max(typical, 1e-30), LEAST_AREA, LARGEST_AREA)
    row_weights = np.maximum(model.opacities, LEAST_OPACITY) * sizes
    weights: Float64 = np.bincount(places, row_weights).astype(np.float64)
    shares = (row_weights / weights[places])[:, None]

    def means(values: NDArray[Any]) -> Float64:
        """Return the mean [C,3] of values [K,3] over the rows of each cell."""
        return np.stack([np.bincount(places, column) for column in (shares * values).T], axis=1)

    colours = means(SH_DC * model.sh_coeffs[:, 0].astype(np.float64))
    centres = means(model.means)
    nearest = range(2, min(AROUND + 1, len(cells)) + 1)
    if not nearest:
        return CellColours(cells, places, np.zeros_like(colours), np.zeros((len(cells), 0), np.intp), weights)
    _, neighbours = KDTree(centres).query(centres, k=nearest)
    return CellColours(cells, places, colours - np.median(colours[neighbours], axis=1), neighbours, weights)


def blind(model: Gaussians, grid: Grid) -> tuple[Cells, Float64]:
    """Return cells [C] and what their rows show [C,3], in deviations of the cells around."""
    colours = cell_colours(model, grid)
    if not colours.neighbours.size:
        return colours.cells, colours.residuals
    deviations = np.median(np.abs(colours.residuals)[colours.neighbours], axis=1)
    white = np.clip(colours.residuals / np.maximum(deviations, 1e-3), -DEVIATIONS, DEVIATIONS)
    weights = np.sqrt(np.minimum(colours.weights / np.median(colours.weights), LARGEST_WEIGHT))
    return colours.cells, white * weights[:, None]


def copied(marked: Gaussians, onto: Gaussians) -> Gaussians:
    """Return a model with what sets the cells of a marked one apart from those around, as far as it can be a mark."""
    grid = Grid.of(marked)
    colours = cell_colours(marked, grid)
    wanted = grid.cells(onto)
    places = np.minimum(np.searchsorted(colours.cells, wanted), len(colours.cells) - 1)
    is_known = colours.cells[places] == wanted
    changes = np.clip(colours.residuals, -LARGEST_MARK, LARGEST_MARK)[places]
    return recoloured(onto, np.where(is_known[:, None], changes, 0))


def smoothed(model: Gaussians, grid: Grid, clip: float, passes: int) -> Gaussians:
    """Return a model without what sets its cells apart from those around, at most `clip` (of 1) in each pass."""
    for _ in range(passes):
        colours = cell_colours(model, grid)
        model = recoloured(model, -np.clip(colours.residuals, -clip, clip)[colours.places])
    return model


def informed(
    clean: Gaussians, grid: Grid, views: Sequence[Camera], residuals: Sequence[Float32], device: Device | None = None
) -> tuple[Cells, Float64]:
    """Return the cells [C] of the clean model, and what residual renders show there: [R,C,3].

    Each of the R `residuals` [V,H,W,3] is a difference of renders.
    """
    cells, places = np.unique(grid.cells(clean), return_inverse=True)
    totals = np.zeros((len(residuals), len(cells), 3))
    renderer = Renderer(clean, device)
    for number, view in enumerate(views):
        _, pullback = renderer.vjp(view)
        for trial, differences in enumerate(residuals):
            gradients = pullback(differences[number]).channels[:, 0]
            totals[trial] += np.stack([np.bincount(places, column, len(cells)) for column in gradients.T], axis=1)
    return cells, totals


def renders(model: Gaussians, views: Sequence[Camera], device: Device | None = None) -> Float32:
    """Return the renders [V,H,W,3] of a model, clipped to 0 .. 1."""
    renderer = Renderer(model, device)
    return np.stack([renderer.image(view).clip(0, 1) for view in views])


def colour_mapped(images: Float32, references: Sequence[Float32]) -> list[Float32]:
    """Return images after the quadratic map of each channel that brings most of their pixels to each reference."""
    mapped = [np.empty_like(images) for _ in references]
    for channel in range(3):
        x = images[..., channel].ravel().astype(np.float64)
        powers = np.stack([np.ones_like(x), x, x * x], axis=1)
        for reference, result in zip(references, mapped, strict=True):
            result[..., channel] = _fitted(powers, reference[..., channel].ravel()).reshape(images.shape[:-1])
    return mapped


def _fitted(powers: Float64, y: Float32) -> Float64:
    """Return the polynomial of the `powers` [N,3] that comes close to most of the numbers y [N]."""
    weights = np.ones(len(y))
    weighted = np.empty_like(powers)
    for _ in range(REWEIGHTINGS):
        np.multiply(powers, weights[:, None], out=weighted)
        coefficients = np.linalg.solve(weighted.T @ powers + 1e-9 * np.eye(3), weighted.T @ y)
        np.matmul(powers, coefficients, out=weights)  # in place, without fresh memory
        np.subtract(y, weights, out=weights)
        weights /= TOLERANCE
        np.square(weights, out=weights)
        weights += 1
        np.divide(1, weights, out=weights)
    return np.asarray(powers @ coefficients)


def whitened(residuals: Float32) -> Float32:
    """Return residuals [V,H,W,3] without outliers, each divided by the variance around it."""
    from scipy.ndimage import uniform_filter

    is_outlier = np.abs(residuals).max(axis=-1, keepdims=True) > OUTLIER
    residuals = np.where(is_outlier, np.float32(0), residuals)
    variances = uniform_filter(np.square(residuals).mean(axis=-1), (0, WINDOW, WINDOW))[..., None]
    deviations = np.sqrt(np.maximum(variances, 0)) + np.float32(NOISE)
    return np.asarray(np.clip(residuals / deviations, -3, 3) / deviations, np.float32)
