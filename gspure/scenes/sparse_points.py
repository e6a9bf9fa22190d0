"""Points on what photographs show, in the place of those that structure from motion finds in real ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera

PER_VIEW = 200
"""Ours: a few thousand in all for a default pair."""


def seen_points(
    camera: Camera, image: NDArray[np.float32], depth: NDArray[np.float32], rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Return positions [P,3] and 8-bit colours [P,3] of what random pixels of a photograph show.

    `image` and `depth` are what `gspure.scenes.ray_tracer.trace` gave for the view.
    """
    hits = np.flatnonzero(np.isfinite(depth))
    chosen = np.sort(rng.choice(hits, min(PER_VIEW, len(hits)), replace=False))
    rows, columns = np.divmod(chosen, camera.width)
    pixels = np.stack([columns + 0.5, rows + 0.5, np.ones(len(chosen))])
    there = np.linalg.solve(camera.K, pixels) * depth[rows, columns]
    xyz = (there - camera.viewmat[:3, 3:]).T @ camera.viewmat[:3, :3]
    return xyz, np.floor(255 * image[rows, columns] + 0.5).astype(np.uint8)
