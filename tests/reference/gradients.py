"""Gradients of a rendering (energy ``ewa``) with respect to all of its inputs, by the chain rule.

The rules of blending have steps (the cut-off, the stop, the order of depths). As in every 3DGS trainer, a gradient
ignores these steps, and is zero through an active clamp.
"""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float64
from gspure.cameras.camera import Camera
from gspure.constants import ALPHA_MAX, ALPHA_MIN, TRANSMITTANCE_MIN
from gspure.model.gaussians import Gaussians
from gspure.model.rotations import rotation_matrices
from tests.reference.projection import (
    Splats,
    bounded_scales,
    clamped_slopes,
    pixel_centres,
    project,
    projection_jacobians,
)
from tests.reference.spherical_harmonics import sh_basis, sh_basis_gradients, sh_colors


@dataclass(frozen=True)
class Gradients:
    """Gradients by row of the model.

    Of `means` [K,3], `quats` [K,4] as stored, `scales` [K,3], `opacities` [K], `channels` ([K,S,3] SH coefficients, or
    [K,C] features) and, in pixels, of the projected centres `means2d` [K,2].
    """

    means: Float64
    quats: Float64
    scales: Float64
    opacities: Float64
    channels: Float64
    means2d: Float64


@dataclass(frozen=True)
class SplatGradients:
    """Gradients of the inputs of blending, by row: centres in pixels, Sigma' (symmetric), opacities, channels."""

    means2d: Float64
    covs2d: Float64
    opacities: Float64
    channels: Float64


def pull_back(
    model: Gaussians,
    camera: Camera,
    image_gradient: NDArray[Any],
    features: NDArray[Any] | None = None,
    background: NDArray[Any] | None = None,
) -> Gradients:
    """Carry the gradient [H,W,C] of the image that `render` makes of the same arguments back to the parameters."""
    splats = cast("Splats", project(model, camera, "ewa"))
    colours = sh_colors(model.sh_coeffs, model.means, camera.centre) if features is None else np.asarray(features)
    background = np.zeros(colours.shape[1]) if background is None else np.asarray(background, np.float64)
    by_splats = blend_backward(splats, camera, colours, background, np.asarray(image_gradient, np.float64))
    means, quats, scales = project_backward(model, camera, splats, by_splats)
    channels = by_splats.channels
    if features is None:
        channels, by_direction = sh_colors_backward(model.sh_coeffs, model.means, camera.centre, by_splats.channels)
        means += by_direction
    return Gradients(means, quats, scales, by_splats.opacities, channels, by_splats.means2d)


def blend_backward(
    splats: Splats, camera: Camera, channels: Float64, background: Float64, image_gradient: Float64
) -> SplatGradients:
    """Go through the Gaussians front to back, then again back to front with the colour that lies behind each.

    With C_k the colour behind Gaussian k (its share of the light taken as 1), the image is a sum of constant terms and
    T_k (alpha_k c_k + (1 - alpha_k) C_k), hence dL/dalpha_k = T_k (c_k - C_k) . g, and C_(k-1) = alpha_k c_k +
    (1 - alpha_k) C_k.
    """
    u, v = pixel_centres(camera)
    count = len(channels)
    gradients = SplatGradients(np.zeros((count, 2)), np.zeros((count, 2, 2)), np.zeros(count), np.zeros(channels.shape))
    walked = []
    transmittance, alive = np.ones(u.shape), np.ones(u.shape, bool)
    for i in range(len(splats.rows)):
        energy, _ = splats.evaluate(i, u, v)
        alpha = np.minimum(ALPHA_MAX, splats.opacities[i] * energy)
        after = transmittance * (1 - alpha)
        touched = alive & (alpha >= ALPHA_MIN)
        blended = touched & (after >= TRANSMITTANCE_MIN)
        walked.append((energy, np.where(blended, alpha, 0.0), transmittance))
        transmittance = np.where(blended, after, transmittance)
        alive &= blended | ~touched

    behind = np.broadcast_to(background, image_gradient.shape)
    for i, (energy, alpha, before) in reversed(list(enumerate(walked))):
        row = splats.rows[i]
        gradients.channels[row] = np.einsum("hw,hwc->c", alpha * before, image_gradient)
        by_alpha = before * np.einsum("hwc,hwc->hw", channels[row] - behind, image_gradient)
        by_alpha[(alpha == 0) | (splats.opacities[i] * energy >= ALPHA_MAX)] = 0.0
        behind = behind + alpha[..., None] * (channels[row] - behind)

        gradients.opacities[row] = (by_alpha * energy).sum()
        # E = exp(-q / 2) with q = d^T P d, P = Sigma'^-1: dq/dd = 2 P d, dq/dSigma' = -(P d) (P d)^T.
        by_q = -0.5 * by_alpha * splats.opacities[i] * energy
        offset = np.stack([u, v], axis=-1) - splats.means2d[i]
        pulled = offset @ np.linalg.inv(splats.covs2d[i])
        gradients.means2d[row] = -2 * np.einsum("hw,hwa->a", by_q, pulled)
        gradients.covs2d[row] = -np.einsum("hw,hwa,hwb->ab", by_q, pulled, pulled)
    return gradients


def project_backward(
    model: Gaussians, camera: Camera, splats: Splats, by_splats: SplatGradients
) -> tuple[Float64, Float64, Float64]:
    """Return the gradients of means, quaternions and scales; zero for invisible Gaussians."""
    rows, rotation = splats.rows, camera.viewmat[:3, :3]
    scales = bounded_scales(model.scales[rows].astype(np.float64), splats.depths, camera, "ewa")
    axes = rotation @ rotation_matrices(model.quats[rows])
    by_cov2d, jacobians = by_splats.covs2d[rows], projection_jacobians(splats.means, camera)
    by_cov = jacobians.transpose(0, 2, 1) @ by_cov2d @ jacobians  # Sigma' = J Sigma J^T + 0.3 I
    by_jacobian = 2 * by_cov2d @ jacobians @ splats.covs
    by_stretched = 2 * by_cov @ (axes * scales[:, None, :])  # Sigma = (axes S) (axes S)^T
    by_view = centre_backward(splats.means, camera, by_splats.means2d[rows], by_jacobian)

    by_means, by_quats, by_scales = (np.zeros((len(model.means), size)) for size in (3, 4, 3))
    by_means[rows] = by_view @ rotation
    by_quats[rows] = quaternions_backward(model.quats[rows], rotation.T @ (by_stretched * scales[:, None, :]))
    by_scales[rows] = (by_stretched * axes).sum(axis=1)
    return by_means, by_quats, by_scales


def centre_backward(means: Float64, camera: Camera, by_means2d: Float64, by_jacobian: Float64) -> Float64:
    """Return the gradients [V,3] of view-space centres, which move the splats and turn the Jacobians J.

    J = [[fx / z, 0, -fx s / z], [0, fy / z, -fy t / z]] with the clamped slopes (s, t) of x / z and y / z.
    """
    z, slopes = means[:, 2], clamped_slopes(means, camera)
    by_view = np.zeros_like(means)
    for axis in (0, 1):
        focal, slope = camera.K[axis, axis], means[:, axis] / z
        by_slope = focal * by_means2d[:, axis]  # u = fx x / z + cx
        by_slope += np.where(slopes[:, axis] == slope, -focal / z * by_jacobian[:, axis, 2], 0.0)
        by_inverse = focal * (by_jacobian[:, axis, axis] - slopes[:, axis] * by_jacobian[:, axis, 2])
        by_view[:, axis] += by_slope / z
        by_view[:, 2] -= by_slope * slope / z + by_inverse / z**2
    return by_view


def quaternions_backward(quats: NDArray[Any], by_rotation: Float64) -> Float64:
    """Return the gradients [K,4] of quaternions, of any norm, from those of their rotations [K,3,3]."""
    quats = np.asarray(quats, np.float64)
    norms = np.linalg.norm(quats, axis=1, keepdims=True)
    w, x, y, z = (quats / norms).T
    zero = np.zeros_like(w)
    derivatives = 2 * np.array(  # of the rotation's entries, by w, x, y and z
        [
            [[zero, -z, y], [z, zero, -x], [-y, x, zero]],
            [[zero, y, z], [y, -2 * x, -w], [z, w, -2 * x]],
            [[-2 * y, x, w], [x, zero, z], [-w, z, -2 * y]],
            [[-2 * z, -w, x], [w, -2 * z, y], [x, y, zero]],
        ]
    )
    by_units = np.einsum("qabk,kab->kq", derivatives, by_rotation)
    return np.asarray(across(quats / norms, by_units) / norms)


def sh_colors_backward(
    sh_coeffs: NDArray[Any], means: NDArray[Any], centre: NDArray[Any], by_colors: Float64
) -> tuple[Float64, Float64]:
    """Return the gradients of the coefficients [K,S,3] and, through the direction of view, of the means [K,3]."""
    towards = np.asarray(means, np.float64) - centre
    distances = np.maximum(np.linalg.norm(towards, axis=1, keepdims=True), np.finfo(float).tiny)
    directions, bands = towards / distances, sh_coeffs.shape[1]
    by_colors = np.where(sh_colors(sh_coeffs, means, centre) > 0, by_colors, 0.0)
    by_coeffs = np.einsum("ks,kc->ksc", sh_basis(directions)[:, :bands], by_colors)
    by_basis = np.einsum("ksc,kc->ks", np.asarray(sh_coeffs, np.float64), by_colors)
    by_directions = np.einsum("ks,ksa->ka", by_basis, sh_basis_gradients(directions)[:, :bands])
    return by_coeffs, across(directions, by_directions) / distances


def across(units: Float64, gradients: Float64) -> Float64:
    """Return the part of `gradients` perpendicular to `units`, row by row: normalization removes the rest."""
    return np.asarray(gradients - units * (units * gradients).sum(axis=1, keepdims=True))
