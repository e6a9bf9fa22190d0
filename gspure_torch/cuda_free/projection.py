"""The projection of 3DGS in PyTorch, where its interface shows it: cameras, covariances, radii, visibility."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from gspure.cameras.camera import Camera, intrinsics
from gspure.constants import EWA_DILATION, EWA_FRUSTUM_MARGIN, NEAR_PLANE
from gspure_torch.pytorch import on_host, torch

_TRIANGLE: Final = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))  # of a symmetric matrix
_CENTRED: Final = 1e-5  # rounding error of a principal point, in half image sides
_LEAST_SPREAD: Final = 0.1  # of the eigenvalues of a splat, in square pixels (reference rasterizer)
_LEAST_SHARE: Final = 0.000025  # of an opacity that is left by antialiasing, squared (reference rasterizer)


def camera_of(settings: Any) -> Camera:
    """Return the view of `GaussianRasterizationSettings`.

    Its matrices are those of 3DGS, for row vectors. The focal lengths are those of the fields of view; the principal
    point is that of the projection matrix.
    """
    viewmat = on_host(settings.viewmatrix).T.astype(np.float64)
    viewmat[3] = 0, 0, 0, 1
    projection = on_host(settings.projmatrix).T.astype(np.float64) @ np.linalg.inv(viewmat)
    offset = projection[:2, 2] / projection[3, 2]
    offset[np.abs(offset) < _CENTRED] = 0
    width = int(settings.image_width)
    height = int(settings.image_height)
    fx = width / (2 * settings.tanfovx)
    fy = height / (2 * settings.tanfovy)
    K = intrinsics(fx, fy, width / 2 * (1 + offset[0]), height / 2 * (1 + offset[1]))
    return Camera(name="view", width=width, height=height, K=K, viewmat=viewmat)


def seen_from(camera: Camera, means: torch.Tensor) -> torch.Tensor:
    """Return x, y and z of the `means` [K,3] in the axes of the camera: [3,K]."""
    viewmat = torch.as_tensor(camera.viewmat, dtype=means.dtype, device=means.device)
    return viewmat[:3, :3] @ means.T + viewmat[:3, 3:]


def depths(camera: Camera, means: torch.Tensor) -> torch.Tensor:
    """Return the view depths [K] of the `means`, at least `NEAR_PLANE`."""
    return seen_from(camera, means)[2].clamp_min(NEAR_PLANE)


def world_covariances(quats: torch.Tensor, scales: torch.Tensor) -> torch.Tensor:
    """Return the covariances [6,K] of Gaussians with quaternions of any norm: xx, xy, xz, yy, yz, zz."""
    components = quats.T.contiguous()
    w, x, y, z = components * components.square().sum(0).rsqrt()
    rotation = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    squares = scales.T.contiguous() ** 2
    elements = [
        sum(rotation[row][axis] * rotation[column][axis] * squares[axis] for axis in range(3))
        for row, column in _TRIANGLE
    ]
    return torch.stack(elements)


def axes_of(covariances: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return quaternions [K,4] and scales [K,3] of covariances [6,K]; no gradient flows through them."""
    from scipy.spatial.transform import Rotation

    matrices = on_host(covariances).astype(np.float64)[[0, 1, 2, 1, 3, 4, 2, 4, 5]].T.reshape(-1, 3, 3)
    squares, vectors = np.linalg.eigh(matrices)
    vectors[:, :, 0] *= np.sign(np.linalg.det(vectors))[:, None]
    quats = Rotation.from_matrix(vectors).as_quat(scalar_first=True)
    scales = np.sqrt(np.maximum(squares, 0))
    arrays = (quats.astype(np.float32), scales.astype(np.float32))
    quat_tensor, scale_tensor = (torch.from_numpy(array).to(covariances.device) for array in arrays)
    return quat_tensor, scale_tensor


def image_covariances(camera: Camera, means: torch.Tensor, covariances: torch.Tensor) -> torch.Tensor:
    """Return the covariances [3,K] on the image plane, xx, xy and yy in square pixels, before their dilation."""
    width = camera.width
    height = camera.height
    fx, fy, cx, cy = camera.numbers[2:6].tolist()
    margin_x = EWA_FRUSTUM_MARGIN * 0.5 * width / fx
    margin_y = EWA_FRUSTUM_MARGIN * 0.5 * height / fy
    x, y, z = seen_from(camera, means)
    z = z.clamp_min(NEAR_PLANE)
    slope_x = (x / z).clamp(-cx / fx - margin_x, (width - cx) / fx + margin_x)
    slope_y = (y / z).clamp(-cy / fy - margin_y, (height - cy) / fy + margin_y)
    right, down, ahead = camera.viewmat[:3, :3].tolist()
    across = [fx / z * (right[axis] - slope_x * ahead[axis]) for axis in range(3)]  # the Jacobian's two rows
    along = [fy / z * (down[axis] - slope_y * ahead[axis]) for axis in range(3)]
    xx, xy, xz, yy, yz, zz = covariances
    rows = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
    spread_x = [_dot(row, across) for row in rows]
    spread_y = [_dot(row, along) for row in rows]
    return torch.stack([_dot(across, spread_x), _dot(along, spread_x), _dot(along, spread_y)])


def _dot(a: Sequence[torch.Tensor], b: Sequence[torch.Tensor]) -> torch.Tensor:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def antialiasing(covariances: torch.Tensor) -> torch.Tensor:
    """Return the share [K] of its opacity that a splat keeps when dilation spreads it (reference rasterizer)."""
    xx, xy, yy = covariances
    share = (xx * yy - xy * xy) / ((xx + EWA_DILATION) * (yy + EWA_DILATION) - xy * xy)
    return share.clamp_min(_LEAST_SHARE).sqrt()
