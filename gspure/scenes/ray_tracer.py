"""A small deterministic ray tracer: photographs and depth of a lit scene."""

import numpy as np

from gspure.cameras.camera import Camera
from gspure.files import Bools, Float32, Float64
from gspure.scenes.lighting import LitScene
from gspure.scenes.scene import displayed

EDGE = 1.0 / 64.0  # a pixel whose display value differs by more than this from a neighbour's is sampled more finely
_RAYS_AT_ONCE = 1 << 15  # rays traced together: bounds the memory that a large photograph takes


def trace(scene: LitScene, camera: Camera, *, samples: int = 3) -> tuple[Float32, Float32]:
    """Photograph a scene (see `gspure.scenes.lighting.bake`).

    Return the image [H,W,3] in 0..1 and the depth [H,W], the view-space z along the ray through the pixel's centre in
    metres; inf where it leaves the scene. A pixel at an edge is the mean of `samples` by `samples` rays, an odd number,
    through the centres of its equal squares; any other is its centre's ray.
    """
    if samples < 1 or samples % 2 == 0:
        raise ValueError(f"samples must be odd, so that one ray is the pixel centre's; not {samples}")
    rows, columns = np.indices((camera.height, camera.width)) + 0.5
    flat, depth = _colours(scene, camera, columns.ravel(), rows.ravel())
    image = flat.reshape(camera.height, camera.width, 3)
    edges = np.nonzero(_at_edges(image))
    down, right = (np.indices((samples, samples)).reshape(2, -1) + 0.5) / samples
    fine, _ = _colours(scene, camera, np.add.outer(edges[1], right).ravel(), np.add.outer(edges[0], down).ravel())
    image[edges] = fine.reshape(-1, samples**2, 3).sum(axis=1) / samples**2
    return image.astype(np.float32), depth.reshape(camera.height, camera.width).astype(np.float32)


def _colours(scene: LitScene, camera: Camera, u: Float64, v: Float64) -> tuple[Float64, Float64]:
    """Return display colours [N,3] and depths [N] at image positions (u, v), in pixels."""
    right, down, forward = camera.viewmat[:3, :3]
    colours, depths = np.empty((len(u), 3)), np.empty(len(u))
    for start in range(0, len(u), _RAYS_AT_ONCE):
        part = slice(start, start + _RAYS_AT_ONCE)
        x = (u[part] - camera.K[0, 2]) / camera.K[0, 0]
        y = (v[part] - camera.K[1, 2]) / camera.K[1, 1]
        # view-space z is 1, so that ray parameters are depths
        directions = np.stack([x * right[i] + y * down[i] + forward[i] for i in range(3)], axis=1)
        radiance, depths[part] = scene.traced(np.broadcast_to(camera.centre, directions.shape), directions)
        colours[part] = np.where(np.isinf(depths[part])[:, None], scene.scene.background, displayed(radiance))
    return colours, depths


def _at_edges(image: Float64) -> Bools:
    """Return the pixels [H,W] that differ from one of their eight neighbours."""
    height, width = image.shape[:2]
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    ends = []
    for extreme in (np.maximum, np.minimum):
        across = extreme.reduce([padded[:, i : i + width] for i in range(3)])
        ends.append(extreme.reduce([across[i : i + height] for i in range(3)]))
    edges: Bools = (ends[0] - ends[1] > EDGE).any(axis=2)
    return edges
