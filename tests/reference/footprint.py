"""Which part of the image a Gaussian reaches: where alpha >= 1/255."""

import numpy as np

from gspure.arrays import Float64
from gspure.constants import ALPHA_MIN
from tests.reference.projection import Rays, Splats


def extents(projection: Splats | Rays) -> Float64:
    """Return the tight box (left, top, right, bottom) [V,4], in pixels, of each Gaussian's {alpha >= 1/255}.

    A Gaussian too faint to reach 1/255 anywhere has the box (nan, nan, nan, nan); one whose reach surrounds the
    camera plane has an infinite box. The near plane's cut of the ``ray`` energy is not taken into account.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        cutoff = 2 * np.log(projection.opacities / ALPHA_MIN)  # the squared Mahalanobis distance of the contour
        cutoff = np.where(cutoff >= 0, cutoff, np.nan)
        boxes = splat_extents(projection, cutoff) if isinstance(projection, Splats) else ray_extents(projection, cutoff)
    boxes[np.isnan(cutoff)] = np.nan
    return boxes


def splat_extents(splats: Splats, cutoff: Float64) -> Float64:
    """Bound the ellipse d^T Sigma'^-1 d <= cutoff: it spans sqrt(cutoff Sigma'_aa) to both sides along axis a."""
    half = np.sqrt(cutoff[:, None] * splats.covs2d[:, [0, 1], [0, 1]])
    return np.concatenate([splats.means2d - half, splats.means2d + half], axis=1)


def ray_extents(rays: Rays, cutoff: Float64) -> Float64:
    """Bound the rays that meet the ellipsoid (x - mu)^T Sigma^-1 (x - mu) <= cutoff: a cone cut by the image plane.

    A plane l.x = 0 through the camera touches the ellipsoid when (l.mu)^2 = cutoff l^T Sigma l. The planes x = s z give
    a quadratic a s^2 - 2 b s + c = 0 for the smallest and largest slope s. The cut is an ellipse exactly when a > 0:
    the ellipsoid lies wholly on one side of the camera plane z = 0.
    """
    z, zz = rays.means[:, 2], rays.covs[:, 2, 2]
    a = z**2 - cutoff * zz
    low, high = np.empty((len(z), 2)), np.empty((len(z), 2))
    for axis in (0, 1):
        b = rays.means[:, axis] * z - cutoff * rays.covs[:, axis, 2]
        c = rays.means[:, axis] ** 2 - cutoff * rays.covs[:, axis, axis]
        half = np.sqrt(np.maximum(b * b - a * c, 0.0))
        focal, principal = rays.intrinsics[axis, axis], rays.intrinsics[axis, 2]
        low[:, axis] = np.where(a > 0, focal * (b - half) / a + principal, -np.inf)
        high[:, axis] = np.where(a > 0, focal * (b + half) / a + principal, np.inf)
    return np.concatenate([low, high], axis=1)
