"""Gradients of a rendering (energy ``ewa``) with respect to all of its inputs.

Blending is differentiated by the chain rule, and what it blends by complex steps.

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
from tests.reference.projection import Splats, bounded_scales, pixel_centres, project, splat_covariances
from tests.reference.spherical_harmonics import sh_basis, sh_colors, view_directions

Complex = NDArray[np.complex128]
STEP = 1e-60
"""The imaginary part of f(x + ih) is h f'(x) + O(h^3), without a difference that rounds (Squire and Trapp 1998)."""


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
    means2d, covs2d, opacities, channels = blend_backward(splats, camera, colours, background, image_gradient)
    rows = splats.rows
    parameters = {name: getattr(model, name)[rows].astype(np.complex128) for name in ("means", "quats", "scales")}
    parameters["scales"][:] = bounded_scales(parameters["scales"].real, splats.depths, camera, "ewa")
    gradients = [means2d[rows], covs2d[rows]]
    if features is None:
        gradients.append(channels[rows])
        basis = sh_basis(view_directions(model.means, camera.centre))[:, : model.sh_coeffs.shape[1]]
        channels = np.einsum("ks,kc->ksc", basis, np.where(colours > 0, channels, 0.0))

    def pulled(name: str) -> Float64:
        """Return the gradient of a parameter, one column at a time."""
        gradient = np.zeros(getattr(model, name).shape)
        for column in range(gradient.shape[1]):
            moved = parameters[name].copy()
            moved[:, column] += 1j * STEP
            inputs = inputs_of_blending(**parameters | {name: moved}, sh_coeffs=model.sh_coeffs[rows], camera=camera)
            for by_input, values in zip(gradients, inputs, strict=False):
                terms = by_input * values.imag / STEP
                gradient[rows, column] += terms.sum(axis=tuple(range(1, terms.ndim)))
        return gradient

    return Gradients(pulled("means"), pulled("quats"), pulled("scales"), opacities, channels, means2d)


def blend_backward(
    splats: Splats, camera: Camera, channels: Float64, background: Float64, image_gradient: NDArray[Any]
) -> tuple[Float64, Float64, Float64, Float64]:
    """Return the gradients, by row, of centres in pixels, Sigma' (symmetric), opacities and channels.

    Go through the Gaussians front to back, then again back to front with the colour that lies behind each.

    With C_k the colour behind Gaussian k (its share of the light taken as 1), the image is a sum of constant terms and
    T_k (alpha_k c_k + (1 - alpha_k) C_k), hence dL/dalpha_k = T_k (c_k - C_k) . g, and C_(k-1) = alpha_k c_k +
    (1 - alpha_k) C_k.
    """
    u, v = pixel_centres(camera)
    count = len(channels)
    by_means2d, by_covs2d = np.zeros((count, 2)), np.zeros((count, 2, 2))
    by_opacities, by_channels = np.zeros(count), np.zeros(channels.shape)
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
        by_channels[row] = np.einsum("hw,hwc->c", alpha * before, image_gradient)
        by_alpha = before * np.einsum("hwc,hwc->hw", channels[row] - behind, image_gradient)
        by_alpha[(alpha == 0) | (splats.opacities[i] * energy >= ALPHA_MAX)] = 0.0
        behind = behind + alpha[..., None] * (channels[row] - behind)

        by_opacities[row] = (by_alpha * energy).sum()
        # E = exp(-q / 2) with q = d^T P d, P = Sigma'^-1: dq/dd = 2 P d, dq/dSigma' = -(P d) (P d)^T.
        by_q = -0.5 * by_alpha * splats.opacities[i] * energy
        offset = np.stack([u, v], axis=-1) - splats.means2d[i]
        pulled = offset @ np.linalg.inv(splats.covs2d[i])
        by_means2d[row] = -2 * np.einsum("hw,hwa->a", by_q, pulled)
        by_covs2d[row] = -np.einsum("hw,hwa,hwb->ab", by_q, pulled, pulled)
    return by_means2d, by_covs2d, by_opacities, by_channels


def inputs_of_blending(
    means: Complex, quats: Complex, scales: Complex, sh_coeffs: NDArray[Any], camera: Camera
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return centres in pixels [V,2], Sigma' [V,2,2] and colours [V,3] of complex parameters."""
    rotation = camera.viewmat[:3, :3]
    view = means @ rotation.T + camera.viewmat[:3, 3]
    means2d = view[:, :2] / view[:, 2:] * camera.K.diagonal()[:2] + camera.K[:2, 2]
    w, xyz = quats[:, :1, None], quats[:, 1:]
    # R = ((w^2 - u.u) I + 2 u u^T + 2 w [u]x) / |q|^2 for a quaternion q = (w, u) of any norm
    turns = (w * w - (xyz * xyz).sum(axis=1)[:, None, None]) * np.eye(3) + 2 * xyz[:, :, None] * xyz[:, None]
    turns = turns + 2 * w * np.cross(xyz[:, None], np.eye(3)).transpose(0, 2, 1)
    stretched = rotation @ turns / (quats * quats).sum(axis=1)[:, None, None] * scales[:, None]
    covs2d = splat_covariances(stretched @ stretched.transpose(0, 2, 1), view, camera)
    return means2d, covs2d, sh_colors(sh_coeffs, means, camera.centre)
