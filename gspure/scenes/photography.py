"""Cameras on a closed, smooth path in front of a scene, its photographs as files, and points on what they show."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gspure.cameras.camera import Camera, intrinsics, looking_at
from gspure.files import Float32, Float64, UInt8
from gspure.images import write_image
from gspure.progress import track
from gspure.scenes.lighting import LitScene
from gspure.scenes.ray_tracer import trace

TARGET = (0.0, 0.5, 0.75)  # where all cameras look, metres

UP = np.array([0.0, 0.0, 1.0])

PER_VIEW = 200  # points of each view; ours: a few thousand in all for a default pair


def picture(scene: LitScene, cameras: Sequence[Camera], folder: Path) -> None:
    """Write ``folder/VIEW.png`` of each view."""
    for camera in cameras:
        write_image(folder / f"{camera.name}.png", trace(scene, camera)[0])


def photograph(
    scene: LitScene, cameras: Sequence[Camera], folder: Path, rng: np.random.Generator
) -> tuple[Float64, UInt8]:
    """Write ``folder/VIEW.png`` of each view; return points [P,3] on what they show and their 8-bit colours [P,3]."""
    points = []
    for camera in track(cameras, f"photograph {folder.name}"):
        image, depth = trace(scene, camera)
        write_image(folder / f"{camera.name}.png", image)
        points.append(visible_points(camera, image, depth, rng))
    xyz, rgb = zip(*points, strict=True)
    return np.concatenate(xyz), np.concatenate(rgb)


def visible_points(camera: Camera, image: Float32, depth: Float32, rng: np.random.Generator) -> tuple[Float64, UInt8]:
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


def path_cameras(count: int, width: int, height: int) -> list[Camera]:
    """Return `count` views, 62 degrees wide, along a path that sways to both sides, to and fro, up and down."""
    focal = 0.83 * width
    K = intrinsics(focal, focal, width / 2, height / 2)
    digits = max(3, len(str(count - 1)))
    return [
        Camera(f"view_{i:0{digits}d}", width, height, K, looking_at(_station(i / count), np.array(TARGET), UP))
        for i in range(count)
    ]


def _station(phase: float) -> Float64:
    """Return the camera centre [3] at a phase 0..1 of the path."""
    turn = 2.0 * np.pi * phase
    azimuth = np.radians(38.0) * np.sin(turn)
    radius = 3.7 + 0.5 * np.cos(3.0 * turn)
    height = 1.75 + 0.55 * np.sin(2.0 * turn + 0.6)
    return np.array([radius * np.sin(azimuth), TARGET[1] - radius * np.cos(azimuth), height])
