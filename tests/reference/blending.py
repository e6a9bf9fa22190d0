"""Front-to-back alpha blending over a whole image, one Gaussian at a time."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Bools, Float64
from gspure.cameras.camera import Camera
from gspure.constants import ALPHA_MAX, ALPHA_MIN, MEDIAN_TRANSMITTANCE, NEAR_PLANE, TRANSMITTANCE_MIN, Energy
from gspure.model.gaussians import Gaussians
from tests.reference.projection import Rays, Splats, pixel_centres, project
from tests.reference.spherical_harmonics import sh_colors


@dataclass(frozen=True)
class Margins:
    """How close each pixel [H,W] comes to a discontinuity of the rules, as relative distances (0: on it, inf: never).

    Where a margin is below the rounding of another implementation, that implementation may differ by a finite step;
    everywhere else it must agree closely.
    """

    alpha: Float64  # |alpha / ALPHA_MIN - 1| over all Gaussians met before the pixel stopped: is it touched?
    stop: Float64  # |T (1 - alpha) / TRANSMITTANCE_MIN - 1|: does the pixel stop here?
    median: Float64  # |T (1 - alpha) / MEDIAN_TRANSMITTANCE - 1|: is this the median depth? Concerns the depth only
    near: Float64  # |t* / NEAR_PLANE - 1|: does the ray's maximum lie in front of the near plane? Energy `ray` only
    order: Float64  # relative difference in depth of two Gaussians blended next to each other: which comes first?
    clamp: Float64  # |o E / ALPHA_MAX - 1|: is alpha clamped, so that nothing flows back? Concerns gradients only


@dataclass(frozen=True)
class Reference:
    """The results of a rendering.

    Per pixel: `channels` [H,W,C], `transmittance` [H,W], `depth` [H,W] (median depth, inf where the transmittance
    never falls to 0.5), `margins`. Per Gaussian of the model, over w = alpha T: `sums` [K], `maxima` [K], `pixels` [K].
    """

    channels: Float64
    transmittance: Float64
    depth: Float64
    sums: Float64
    maxima: Float64
    pixels: NDArray[np.int64]
    margins: Margins


def render(
    model: Gaussians,
    camera: Camera,
    energy: Energy,
    features: NDArray[Any] | None = None,
    background: NDArray[Any] | None = None,
) -> Reference:
    """Render a model, or `features` [K,C] of its Gaussians; the background [C] is zero by default."""
    if features is None:
        features = sh_colors(model.sh_coeffs, model.means, camera.centre)
    features = np.asarray(features, np.float64)
    background = np.zeros(features.shape[1]) if background is None else np.asarray(background, np.float64)
    return blend(project(model, camera, energy), camera, features, background)


def blend(projection: Splats | Rays, camera: Camera, features: Float64, background: Float64) -> Reference:
    """Blend the projected Gaussians front to back; `features` [K,C] is indexed by the model's rows."""
    u, v = pixel_centres(camera)
    channels = np.zeros((*u.shape, features.shape[1]))
    transmittance = np.ones(u.shape)
    depth = np.full(u.shape, np.inf)
    alive = np.ones(u.shape, bool)
    sums, maxima, pixels = (np.zeros(len(features), kind) for kind in (float, float, np.int64))
    margins = Margins(*(np.full(u.shape, np.inf) for _ in range(6)))
    last_depth = np.full(u.shape, -np.inf)

    for i, row in enumerate(projection.rows):
        energies, depths = projection.evaluate(i, u, v)
        unclamped = projection.opacities[i] * energies
        alpha = np.minimum(ALPHA_MAX, unclamped)
        after = transmittance * (1 - alpha)
        touched = alive & (alpha >= ALPHA_MIN)
        blended = touched & (after >= TRANSMITTANCE_MIN)

        shrink(margins.alpha, np.abs(unclamped / ALPHA_MIN - 1), alive)
        shrink(margins.clamp, np.abs(unclamped / ALPHA_MAX - 1), touched)
        shrink(margins.stop, np.abs(after / TRANSMITTANCE_MIN - 1), touched)
        shrink(margins.median, np.abs(after / MEDIAN_TRANSMITTANCE - 1), touched)
        shrink(margins.order, 1 - last_depth / projection.depths[i], touched)
        last_depth[touched] = projection.depths[i]
        if isinstance(projection, Rays):
            shrink(margins.near, np.abs(depths / NEAR_PLANE - 1), alive)

        weight = np.where(blended, alpha * transmittance, 0.0)
        channels += weight[..., None] * features[row]
        sums[row], maxima[row], pixels[row] = weight.sum(), weight.max(initial=0.0), blended.sum()
        crosses = blended & (transmittance > MEDIAN_TRANSMITTANCE) & (after <= MEDIAN_TRANSMITTANCE)
        depth = np.where(crosses, depths, depth)
        transmittance = np.where(blended, after, transmittance)
        alive &= blended | ~touched

    channels += transmittance[..., None] * background
    return Reference(channels, transmittance, depth, sums, maxima, pixels, margins)


def centre_contributions(model: Gaussians, camera: Camera) -> tuple[Float64, Float64]:
    """Return the contribution [K] of each Gaussian on the ray through its centre, and its margin.

    The energy is ``ray``. The contribution is 0 where the image does not show the centre. The margin is the smallest
    relative distance of the ray to a step: the cut-off, the stop or the near plane (0: on it, inf: none).
    """
    projection = project(model, camera, "ray")
    u, v = projection.means2d.T
    shown = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    transmittance, margins = np.ones(len(u)), np.full(len(u), np.inf)
    contributions, margin_by_row = np.zeros(len(model)), np.full(len(model), np.inf)
    for i, row in enumerate(projection.rows):
        energies, depths = projection.evaluate(i, u, v)
        alpha = np.minimum(ALPHA_MAX, projection.opacities[i] * energies)
        after = transmittance * (1 - alpha)
        touched = alpha >= ALPHA_MIN
        stops = touched & (after < TRANSMITTANCE_MIN)
        shrink(margins, np.abs(alpha / ALPHA_MIN - 1), transmittance > 0)
        shrink(margins, np.abs(after / TRANSMITTANCE_MIN - 1), touched)
        shrink(margins, np.abs(depths / NEAR_PLANE - 1), transmittance > 0)
        blended = touched & ~stops
        contributions[row] = (alpha * transmittance * blended * shown)[i]
        margin_by_row[row] = margins[i]
        transmittance = np.where(stops, 0.0, np.where(blended, after, transmittance))
    return contributions, margin_by_row


def shrink(smallest: Float64, values: Float64, where: Bools) -> None:
    """Lower `smallest` to `values` in place, at the pixels of `where`."""
    np.minimum(smallest, values, out=smallest, where=where)
