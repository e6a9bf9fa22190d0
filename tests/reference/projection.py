"""From Gaussians and a camera to the energy of each Gaussian at each pixel, by two rules.

`Splats` (energy ``ewa``) is the 2-D splat that vanilla models are trained with; `Rays` (energy ``ray``) is the maximum
of the 3-D Gaussian along the pixel's ray, GSPure's equation for the ray-Gaussian energy. Both hold the visible
Gaussians only, front to back.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Bools, Float64, Indices
from gspure.cameras.camera import Camera
from gspure.constants import (
    COORDINATE_MAX,
    EWA_DEVIATION_MAX,
    EWA_DILATION,
    EWA_FRUSTUM_MARGIN,
    MAGNITUDE_MAX,
    NEAR_PLANE,
    RAY_SCALE_RATIO,
    Energy,
)
from gspure.model.gaussians import Gaussians
from gspure.model.rotations import rotation_matrices


@dataclass(frozen=True)
class Projected:
    """The V visible Gaussians of a view, front to back: by (view z of the centre, row of the model).

    `depths` are the view z of the centres, `means` [V,3] and `covs` [V,3,3] are in view space, `means2d` [V,2] in
    pixels.
    """

    rows: Indices
    depths: Float64
    opacities: Float64
    means: Float64
    covs: Float64
    means2d: Float64


@dataclass(frozen=True)
class Splats(Projected):
    """Energy ``ewa``: a 2-D Gaussian on the image plane, E = exp(-1/2 d^T Sigma'^-1 d)."""

    covs2d: Float64  # Sigma' = J Sigma J^T + dilation, [V,2,2] in square pixels

    def evaluate(self, i: int, u: Float64, v: Float64) -> tuple[Float64, Float64]:
        """Return the i-th Gaussian's energy and depth at the pixel positions (u, v)."""
        offset = np.stack([u - self.means2d[i, 0], v - self.means2d[i, 1]], axis=-1)
        power = np.einsum("...a,ab,...b->...", offset, np.linalg.inv(self.covs2d[i]), offset)
        return np.exp(-0.5 * power), np.full(u.shape, self.depths[i])


@dataclass(frozen=True)
class Rays(Projected):
    """Energy ``ray``: the Gaussian's maximum along the pixel's ray t r, r = ((u - cx) / fx, (v - cy) / fy, 1).

    In the Gaussian's own axes, divided by its scales, it is a unit ball at p and the ray is t d: the closest approach
    lies at t* = p.d / |d|^2 with the squared distance |p x d|^2 / |d|^2.
    """

    axes: Float64  # [V,3,3], principal axes in view space, by column
    scales: Float64  # [V,3], within `RAY_SCALE_RATIO` of the middle one
    intrinsics: Float64  # [3,3], the camera's

    def evaluate(self, i: int, u: Float64, v: Float64) -> tuple[Float64, Float64]:
        """Return the i-th Gaussian's energy and the depth t* of its maximum at the pixel positions (u, v).

        The energy is 0 where t* lies at or before the near plane.
        """
        distances, depth, _ = self.approach(i, pixel_rays(self.intrinsics, u, v))
        return np.where(depth > NEAR_PLANE, np.exp(-0.5 * distances), 0.0), depth

    def approach(self, i: int, rays: Float64) -> tuple[Float64, Float64, Float64]:
        """Return squared distance and depth of the closest approach of `rays` [...,3], and |d|^2.

        With the axes q and scales s, component a of p x d is q_a . (mu x r) s_a / (s_1 s_2 s_3).
        """
        mean, axes, scales = self.means[i], self.axes[i], self.scales[i]
        d, p = rays @ axes / scales, mean @ axes / scales
        products = scales[[1, 2, 0]] * scales[[2, 0, 1]]
        miss = np.cross(mean, rays) @ axes / products
        squared = (d * d).sum(axis=-1)
        return (miss * miss).sum(axis=-1) / squared, d @ p / squared, squared


def project(model: Gaussians, camera: Camera, energy: Energy) -> Splats | Rays:
    """Project the Gaussians that are in range and beyond the near plane, front to back."""
    rotation, translation = camera.viewmat[:3, :3], camera.viewmat[:3, 3]
    means = model.means.astype(np.float64) @ rotation.T + translation
    rows = np.flatnonzero((means[:, 2] > NEAR_PLANE) & in_range(model, means, energy))
    rows = rows[np.argsort(means[rows, 2], kind="stable")]
    means = means[rows]
    scales = bounded_scales(model.scales[rows].astype(np.float64), means[:, 2], camera, energy)
    axes = rotation @ rotation_matrices(model.quats[rows])  # columns: the Gaussian's axes in view space
    stretched = axes * scales[:, None, :]
    u = camera.K[0, 0] * means[:, 0] / means[:, 2] + camera.K[0, 2]
    v = camera.K[1, 1] * means[:, 1] / means[:, 2] + camera.K[1, 2]
    shared = Projected(
        rows=rows,
        depths=means[:, 2],
        opacities=model.opacities[rows].astype(np.float64),
        means=means,
        covs=stretched @ stretched.transpose(0, 2, 1),
        means2d=np.stack([u, v], axis=1),
    )
    if energy == "ewa":
        return Splats(**vars(shared), covs2d=splat_covariances(shared.covs, means, camera))
    return Rays(**vars(shared), axes=axes, scales=scales, intrinsics=camera.K)


def in_range(model: Gaussians, means: Float64, energy: Energy) -> Bools:
    """Return which rows [K], with view-space centres `means`, have numbers that float32 can handle."""
    quats, scales = np.abs(model.quats).max(axis=1), np.sort(model.scales, axis=1)
    drawn = (np.abs(means) <= COORDINATE_MAX).all(axis=1) & (scales[:, 2] <= MAGNITUDE_MAX)
    drawn &= (quats >= 1 / MAGNITUDE_MAX) & (quats <= MAGNITUDE_MAX)
    return drawn & (scales[:, 1] >= 1 / MAGNITUDE_MAX) if energy == "ray" else drawn


def bounded_scales(scales: Float64, depths: Float64, camera: Camera, energy: Energy) -> Float64:
    """Return scales [V,3] within the bounds of docs/numerics.md: relative to the middle one, or in pixels."""
    if energy == "ewa":
        largest: Float64 = EWA_DEVIATION_MAX / camera.K.diagonal()[:2].max() * depths
        return np.minimum(scales, largest[:, None])
    middle = np.median(scales, axis=1, keepdims=True)
    return np.clip(scales, middle / RAY_SCALE_RATIO, middle * RAY_SCALE_RATIO)


def splat_covariances(covs: NDArray[Any], means: NDArray[Any], camera: Camera) -> NDArray[Any]:
    """Return Sigma' = J Sigma J^T + 0.3 I [V,2,2] in square pixels from view-space covariances and centres."""
    J = projection_jacobians(means, camera)
    projected: NDArray[Any] = J @ covs @ J.transpose(0, 2, 1)
    return projected + EWA_DILATION * np.eye(2)


def projection_jacobians(means: NDArray[Any], camera: Camera) -> NDArray[Any]:
    """Return the Jacobians J [V,2,3] of the perspective projection at view-space centres.

    Each centre is first moved into the image's frustum, widened by a share of its half extent: beyond it the
    linearization is useless (Zwicker et al. 2001; bounds as in the 3DGS rasterizer).
    """
    focal, principal = np.diag(camera.K)[:2], camera.K[:2, 2]
    size = np.array([camera.width, camera.height])
    margin = EWA_FRUSTUM_MARGIN * size / (2 * focal)
    slopes = np.clip(means[:, :2] / means[:, 2:], -principal / focal - margin, (size - principal) / focal + margin)
    J = np.zeros((len(means), 2, 3), means.dtype)
    for axis in (0, 1):
        J[:, axis, axis] = camera.K[axis, axis] / means[:, 2]
        J[:, axis, 2] = -J[:, axis, axis] * slopes[:, axis]
    return J


def pixel_rays(intrinsics: Float64, u: Float64, v: Float64) -> Float64:
    """Return the view-space rays [...,3] through pixel positions (u, v), scaled to z = 1."""
    x = (u - intrinsics[0, 2]) / intrinsics[0, 0]
    y = (v - intrinsics[1, 2]) / intrinsics[1, 1]
    return np.stack([x, y, np.ones_like(x)], axis=-1)


def pixel_centres(camera: Camera) -> tuple[Float64, Float64]:
    """Return the positions (u, v) of all pixel centres, each [H,W]."""
    u, v = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    return u, v
