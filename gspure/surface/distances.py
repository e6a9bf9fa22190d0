"""Distances from the visible surface: of rows by median depth, and of Gaussians from a mesh."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from gspure.arrays import Float32, Float64
from gspure.cameras import Camera
from gspure.cameras.camera import points_shown
from gspure.model import Gaussians
from gspure.model.rotations import principal_axes
from gspure.opencl.device import Device, choose_device
from gspure.progress import track
from gspure.public_model import PublicModel
from gspure.renderer import Renderer
from gspure.surface.meshing import Mesh

INVISIBLE: Final = np.finfo(np.float32).max  # distance of rows that no view shows; files hold no infinities
SPLITS: Final = 8  # largest number of parts into which a side of a face is divided; ours


def depth_distances(public: PublicModel, cameras: Sequence[Camera], device: Device | None = None) -> Float32:
    """Return the distance [K] of each row from the surface, in standard deviations along the view axis.

    It is the minimum over the views and the row's Gaussians of |z - median depth of the pixel| / deviation. A row that
    no view shows gets `INVISIBLE`.
    """
    device = device or choose_device()
    nearest = np.full(len(public.model), INVISIBLE, np.float32)
    renderer = None
    for camera in track(cameras, "median depth"):
        gaussians, rows = public.gaussians(camera)
        if renderer is None or renderer.model is not gaussians:
            renderer = Renderer(gaussians, device)
            axes = principal_axes(gaussians)
        along_view = np.einsum("kij,j->ik", axes, camera.viewmat[2, :3])
        deviations = np.sqrt(np.square(along_view).sum(axis=0))
        visible, positions = points_shown(camera, gaussians.means)
        columns, lines = positions[:, :2].astype(np.intp).T
        surface = renderer.depth(camera)[lines, columns]
        with np.errstate(divide="ignore", invalid="ignore"):  # Gaussians without rotation or size
            distances = np.abs(positions[:, 2] - surface) / deviations[visible]
        seen = rows[visible]
        distances = np.fmin(distances, INVISIBLE).astype(np.float32)
        if public.rows_are_gaussians:  # each row once
            nearest[seen] = np.minimum(nearest[seen], distances)
        else:
            np.minimum.at(nearest, seen, distances)
    return nearest


def mesh_distances(model: Gaussians, mesh: Mesh) -> Float32:
    """Return the distance [K] of each centre from the mesh, in units of the Gaussian's largest scale."""
    from scipy.spatial import KDTree

    tree = KDTree(face_points(mesh), leafsize=64, balanced_tree=False, compact_nodes=False)
    distances, _ = tree.query(model.means, workers=-1)
    with np.errstate(divide="ignore", invalid="ignore"):  # Gaussians without size
        return np.asarray(np.fmin(distances / model.scales.max(axis=1), INVISIBLE), np.float32)


def face_points(mesh: Mesh) -> Float64:
    """Return the vertices and points on larger faces, spaced by at most the median of the faces' longest sides.

    The spacing is larger on faces larger than `SPLITS` times that median.
    """
    corners = mesh.vertices[mesh.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = np.ceil(longest / max(np.median(longest), np.finfo(np.float64).tiny)).clip(1, SPLITS)
    points = [mesh.vertices]
    for count in range(2, SPLITS + 1):
        i, j = np.indices((count + 1, count + 1)).reshape(2, -1)
        is_new = (i + j <= count) & (np.maximum(np.maximum(i, j), count - i - j) < count)  # no corner
        grid = np.stack([i, j, count - i - j], axis=1)[is_new] / count
        points.append(np.einsum("gc,fcx->fgx", grid, corners[parts == count]).reshape(-1, 3))
    return np.concatenate(points)
