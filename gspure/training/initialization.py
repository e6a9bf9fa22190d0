"""Initial Gaussians: at the points of structure from motion, or at random points in the views' common volume."""

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, Float64, Indices, UInt8
from gspure.cameras.camera import Camera, points_shown
from gspure.constants import MAX_SH_DEGREE, SH_DC
from gspure.model.gaussians import logit
from gspure.opencl.trainable import Parameters

OPACITY: Final = 0.1  # initial opacity (3DGS)
NEIGHBOURS: Final = 3  # the initial scale is the root mean square distance to this many nearest points (3DGS)
LEAST_SQUARED_DISTANCE: Final = 1e-7  # lower bound of squared distances, in square world units (3DGS)
LEAST_POINTS: Final = NEIGHBOURS + 1

RANDOM_POINTS: Final = 10_000  # number of random points, if none are stored; ours
RANDOM_DEPTHS: Final = (0.1, 10.0)  # range of their view depths, as multiples of the scene's extent; ours
CANDIDATES: Final = 3  # random points for each of the `consistent_points`; with 30, they crowd at plain surfaces; ours
COMMON_SHARE: Final = 0.25  # at least this share of the views, and at least two, contain each random point
_ROUNDS = 20


def gaussians_at(xyz: NDArray[Any], rgb: UInt8) -> Parameters:
    """Return isotropic Gaussians at points [P,3] with these 8-bit colours [P,3], P >= 4.

    Spherical harmonics have degree 3; coefficients above the zeroth are zero.
    """
    from scipy.spatial import KDTree

    count = len(xyz)
    distances = KDTree(xyz).query(xyz, k=NEIGHBOURS + 1)[0][:, 1:]  # the nearest is the point itself
    squared = np.maximum(np.mean(distances**2, axis=1), LEAST_SQUARED_DISTANCE)
    sh_coeffs = np.zeros((count, (MAX_SH_DEGREE + 1) ** 2, 3), np.float32)
    sh_coeffs[:, 0] = (rgb / 255.0 - 0.5) / SH_DC
    return Parameters(
        means=xyz.astype(np.float32),
        quats=np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)),
        log_scales=np.repeat(np.log(squared)[:, None] / 2, 3, axis=1).astype(np.float32),
        opacity_logits=np.full(count, logit(OPACITY)),
        sh_coeffs=sh_coeffs,
    )


def thinned(xyz: Float64, rgb: UInt8, at_most: int | None, seed: int) -> tuple[Float64, UInt8]:
    """Return points [P,3] and colours [P,3], or a random choice of `at_most` of them."""
    if at_most is None or len(xyz) <= at_most:
        return xyz, rgb
    rows = np.sort(np.random.default_rng(seed).choice(len(xyz), at_most, replace=False))
    return xyz[rows], rgb[rows]


def random_points(cameras: Sequence[Camera], extent: float, count: int, rng: np.random.Generator) -> Float64:
    """Return points [<= count, 3] inside the views' common volume; fewer, or none, if it is small or empty.

    They lie on rays through random pixels of random views, at log-uniform depths.
    """
    least = max(2, math.ceil(COMMON_SHARE * len(cameras)))
    batches: list[Float64] = []
    for _ in range(_ROUNDS):
        points = _on_rays(cameras, extent, count, rng)
        batches.append(points[view_counts(points, cameras) >= least])
        if sum(map(len, batches)) >= count:
            break
    return np.concatenate(batches)[:count]


def consistent_points(
    cameras: Sequence[Camera], images: Sequence[Float32], extent: float, rng: np.random.Generator
) -> tuple[Float64, UInt8]:
    """Return at most `RANDOM_POINTS` of the `random_points`, with colours: the points that the images agree on.

    Points on surfaces have one colour in all images [H,W,3] that show them (voxel colouring, Seitz and Dyer 1999);
    occlusion is ignored. The points with the least variance of colour stay.
    """
    points = random_points(cameras, extent, CANDIDATES * RANDOM_POINTS, rng)
    counts = np.zeros((len(points), 1))
    sums = np.zeros((len(points), 3))
    squares = np.zeros((len(points), 3))
    for camera, image in zip(cameras, images, strict=True):
        rows, positions = points_shown(camera, points)
        pixel_columns, pixel_rows, _ = positions.astype(np.intp).T
        colours = image[pixel_rows, pixel_columns].astype(np.float64)
        counts[rows] += 1
        sums[rows] += colours
        squares[rows] += colours**2
    mean = sums / np.maximum(counts, 1)
    variance = (squares / np.maximum(counts, 1) - mean**2).sum(axis=1)
    most = -(-len(points) // CANDIDATES)
    best = np.sort(np.argsort(variance, kind="stable")[:most])
    return points[best], (255 * mean[best]).astype(np.uint8)


def view_counts(points: NDArray[Any], cameras: Sequence[Camera]) -> Indices:
    """Return the number of views [P] whose image contains each point [P,3]."""
    views = np.zeros(len(points), np.intp)
    for camera in cameras:
        views[points_shown(camera, points)[0]] += 1
    return views


def _on_rays(cameras: Sequence[Camera], extent: float, count: int, rng: np.random.Generator) -> Float64:
    chosen = rng.integers(len(cameras), size=count)
    places = rng.random((count, 2))
    near, far = np.log(RANDOM_DEPTHS)
    depths = extent * np.exp(rng.uniform(near, far, count))
    points = np.empty((count, 3))
    for i, camera in enumerate(cameras):
        rows = chosen == i
        positions = places[rows] * np.array([camera.width, camera.height])
        pixels = np.column_stack([positions, np.ones(rows.sum())])
        rays = np.linalg.solve(camera.K, pixels.T) * depths[rows]
        points[rows] = (camera.viewmat[:3, :3].T @ rays).T + camera.centre
    return points
