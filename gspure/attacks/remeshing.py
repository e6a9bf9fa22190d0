"""The attack that keeps of a model its surface and its renders only: a mesh, and flat Gaussians on it again."""

from dataclasses import replace
from typing import Final

import numpy as np

from gspure.arrays import Float32, Float64, UInt8
from gspure.attacks.attack import Rng, Teacher
from gspure.attacks.attacked import Attacked, NotApplicable
from gspure.cameras.camera import points_shown
from gspure.errors import InputError
from gspure.model.gaussians import Gaussians, logit
from gspure.public_model import PublicModel
from gspure.renderer import Renderer
from gspure.settings import Steps
from gspure.surface.meshing import Mesh, extract_mesh, smoothed
from gspure.training.initialization import LEAST_POINTS, gaussians_at
from gspure.training.output import as_gaussians

ITERATIONS: Final = 300  # ours
FLATNESS: Final = 0.1  # thickness of a Gaussian, relative to its width; ours
OPACITY: Final = 0.9  # before training; ours
RATE_FACTOR: Final = 5.0  # on the learning rates, as so few steps begin far from the renders; ours
NEAR: Final = 0.05  # largest difference from the median depth of a pixel that shows a point, relative; ours


def remesh(model: Gaussians, rng: Rng, teacher: Teacher, *, iterations: Steps = ITERATIONS) -> Attacked:
    """Extract the surface as a mesh, put as many flat Gaussians on it, and train them on renders of the model.

    Training takes `iterations` steps. No stored number but the background reaches the result other than through the
    surface and the renders.

    Source: ours.
    """
    if not teacher.public.rows_are_gaussians:
        raise NotApplicable("remesh", "a network computes the Gaussians")
    try:
        mesh = extract_mesh(smoothed(model, teacher.cameras), teacher.cameras, teacher.device)
    except InputError as error:
        raise NotApplicable("remesh", "no surface") from error
    points, normals = _on_faces(mesh, max(len(model), LEAST_POINTS), rng)
    start = gaussians_at(points, _colours(points, teacher))
    log_scales = start.log_scales + np.log([1, 1, FLATNESS]).astype(np.float32)
    flat = replace(
        start,
        quats=_upright(normals),
        log_scales=log_scales,
        opacity_logits=np.full(len(points), logit(OPACITY)),
    )
    trained = teacher.train(PublicModel(as_gaussians(flat)), rng, iterations, "all", RATE_FACTOR)
    is_vanilla = type(teacher.public).attributes is PublicModel.attributes
    removed = "" if is_vanilla else "no extraction of this format reads vanilla 3DGS"
    return Attacked(trained, np.full(len(trained), -1), len(model), removed=removed)


def _on_faces(mesh: Mesh, count: int, rng: Rng) -> tuple[Float64, Float64]:
    """Return random points [P,3] on a mesh, uniform by area, and the unit normals there."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1)
    faces = np.sort(rng.choice(len(areas), count, p=areas / areas.sum()))
    u, v = rng.random((2, count, 1))
    outside = u + v > 1
    u = np.where(outside, 1 - u, u)
    v = np.where(outside, 1 - v, v)
    points = a[faces] + u * (b - a)[faces] + v * (c - a)[faces]
    return points, normals[faces] / areas[faces, None]


def _upright(normals: Float64) -> Float32:
    """Return quaternions [P,4] that turn the z axis along the normals [P,3], or against them."""
    x, y, z = np.where(normals[:, 2:] < 0, -normals, normals).T
    return np.stack([1 + z, -y, x, np.zeros_like(z)], axis=1).astype(np.float32)


def _colours(points: Float64, teacher: Teacher) -> UInt8:
    """Return the mean 8-bit colour of each point [P,3] in the renders that show it; grey where none does."""
    renderer = Renderer(teacher.public.gaussians(teacher.cameras[0])[0], teacher.device)
    counts = np.full((len(points), 1), 1e-3)
    sums = np.full((len(points), 3), 0.5e-3)
    for camera, image in zip(teacher.cameras, teacher.images, strict=True):
        rows, positions = points_shown(camera, points)
        pixel_columns, pixel_rows, _ = positions.astype(np.intp).T
        depths = renderer.depth(camera)[pixel_rows, pixel_columns]
        near = np.abs(positions[:, 2] - depths) <= NEAR * positions[:, 2]
        counts[rows[near]] += 1
        sums[rows[near]] += image[pixel_rows[near], pixel_columns[near]]
    return np.asarray(255 * sums / counts, np.uint8)
