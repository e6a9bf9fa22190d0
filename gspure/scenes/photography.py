"""Photographs of a lit scene by a small deterministic ray tracer, its cameras, and points on the visible surfaces."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gspure.arrays import Bools, Float32, Float64, UInt8
from gspure.cameras.camera import Camera, intrinsics, looking_at
from gspure.images import write_image
from gspure.progress import track
from gspure.scenes.lighting import LitScene
from gspure.scenes.solids import GAMMA

EDGE = 1.0 / 64.0  # a pixel whose display value differs by more than this from a neighbour's is sampled more finely
SAMPLES = 3  # rays along each side of such a pixel; odd, so that one is the pixel centre's
TARGET = np.array([0.0, 0.5, 0.75])  # where all cameras look, metres
PER_VIEW = 200  # points of each view; ours: a few thousand in all for a default pair
_RAYS_AT_ONCE = 1 << 15  # rays traced together: bounds the memory that a large photograph takes


def trace(scene: LitScene, camera: Camera) -> tuple[Float32, Float32]:
    """Photograph a scene (see `gspure.scenes.lighting.bake`).

    Return the image [H,W,3] in 0..1 and the depth [H,W], the view-space z along the ray through the pixel's centre in
    metres; inf where it leaves the scene, black. A pixel at an edge is the mean of `SAMPLES` by `SAMPLES` rays through
    the centres of its equal squares; any other is its centre's ray.
    """
    rows, columns = np.indices((camera.height, camera.width)) + 0.5
    flat, depth = _colours(scene, camera, columns.ravel(), rows.ravel())
    image = flat.reshape(camera.height, camera.width, 3)
    edges = np.nonzero(_at_edges(image))
    down, right = (np.indices((SAMPLES, SAMPLES)).reshape(2, -1) + 0.5) / SAMPLES
    off_centre = np.delete(np.arange(SAMPLES**2), SAMPLES**2 // 2)
    edge_rows, edge_columns = edges
    u = np.add.outer(edge_columns, right[off_centre]).ravel()
    v = np.add.outer(edge_rows, down[off_centre]).ravel()
    around, _ = _colours(scene, camera, u, v)
    samples = np.repeat(image[edges][:, None], SAMPLES**2, axis=1)
    samples[:, off_centre] = around.reshape(-1, len(off_centre), 3)
    image[edges] = samples.sum(axis=1) / SAMPLES**2
    return image.astype(np.float32), depth.reshape(camera.height, camera.width).astype(np.float32)


def _colours(scene: LitScene, camera: Camera, u: Float64, v: Float64) -> tuple[Float64, Float64]:
    """Return display colours [N,3], with a soft shoulder instead of clipping, and depths [N] at pixels (u, v)."""
    right, down, forward = camera.viewmat[:3, :3]
    colours = np.empty((len(u), 3))
    depths = np.empty(len(u))
    for start in range(0, len(u), _RAYS_AT_ONCE):
        part = slice(start, start + _RAYS_AT_ONCE)
        x = (u[part] - camera.K[0, 2]) / camera.K[0, 0]
        y = (v[part] - camera.K[1, 2]) / camera.K[1, 1]
        # view-space z is 1, so that ray parameters are depths
        directions = np.stack([x * right[i] + y * down[i] + forward[i] for i in range(3)], axis=1)
        radiance, depths[part] = scene.traced(np.broadcast_to(camera.centre, directions.shape), directions)
        displayed = (1.0 - np.exp(-radiance)) ** (1.0 / GAMMA)
        colours[part] = np.where(np.isinf(depths[part])[:, None], 0.0, displayed)
    return colours, depths


def _at_edges(image: Float64) -> Bools:
    """Return the pixels [H,W] that differ from one of their eight neighbours."""
    height, width = image.shape[:2]
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    ends = []
    for extreme in (np.maximum, np.minimum):
        across = extreme.reduce([padded[:, i : i + width] for i in range(3)])
        ends.append(extreme.reduce([across[i : i + height] for i in range(3)]))
    return np.asarray((ends[0] - ends[1] > EDGE).any(axis=2))


def photograph(
    scene: LitScene, cameras: Sequence[Camera], folder: Path, rng: np.random.Generator
) -> tuple[Float64, UInt8]:
    """Write ``folder/VIEW.png`` of each view; return `visible_points` [P,3] and their 8-bit colours [P,3]."""
    points = []
    for camera in track(cameras, f"photograph {folder.name}"):
        image, depth = trace(scene, camera)
        write_image(folder / f"{camera.name}.png", image)
        points.append(visible_points(camera, image, depth, rng))
    xyz, rgb = zip(*points, strict=True)
    return np.concatenate(xyz), np.concatenate(rgb)


def visible_points(camera: Camera, image: Float32, depth: Float32, rng: np.random.Generator) -> tuple[Float64, UInt8]:
    """Return positions [P,3] and 8-bit colours [P,3] of the surface at random pixels of a photograph (`trace`)."""
    hits = np.flatnonzero(np.isfinite(depth))
    chosen = np.sort(rng.choice(hits, min(PER_VIEW, len(hits)), replace=False))
    rows, columns = np.divmod(chosen, camera.width)
    pixels = np.stack([columns + 0.5, rows + 0.5, np.ones(len(chosen))])
    in_camera = np.linalg.solve(camera.K, pixels) * depth[rows, columns]
    xyz = (in_camera - camera.viewmat[:3, 3:]).T @ camera.viewmat[:3, :3]
    return xyz, np.floor(255 * image[rows, columns] + 0.5).astype(np.uint8)


def path_cameras(count: int, width: int, height: int) -> list[Camera]:
    """Return `count` views, 62 degrees wide, along a path that sways to both sides, to and fro, up and down."""
    focal = 0.83 * width
    K = intrinsics(focal, focal, width / 2, height / 2)
    digits = max(3, len(str(count - 1)))
    up = np.array([0.0, 0.0, 1.0])
    poses = (looking_at(_station(i / count), TARGET, up) for i in range(count))
    return [Camera(f"view_{i:0{digits}d}", width, height, K, pose) for i, pose in enumerate(poses)]


def _station(phase: float) -> Float64:
    """Return the camera centre [3] at a phase 0..1 of the path."""
    turn = 2.0 * np.pi * phase
    azimuth = np.radians(38.0) * np.sin(turn)
    radius = 3.7 + 0.5 * np.cos(3.0 * turn)
    height = 1.75 + 0.55 * np.sin(2.0 * turn + 0.6)
    return np.array([radius * np.sin(azimuth), TARGET[1] - radius * np.cos(azimuth), height])
