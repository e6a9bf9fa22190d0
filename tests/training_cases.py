"""Small things to train from, shared by the training tests."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from gspure.arrays import Float32, UInt8
from gspure.cameras import Camera, orbit_cameras
from gspure.cameras.colmap import write_colmap
from gspure.model import Gaussians
from gspure.opencl.trainable import DensificationStatistics, Parameters, TrainState
from gspure.renderer import Renderer
from tests.models import points_of


def ring(count: int = 9, width: int = 32, height: int = 24) -> list[Camera]:
    """Views from all sides of the unit cube around the origin."""
    corners = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3), axis=-1).reshape(-1, 3)
    return orbit_cameras(points_of(corners, np.ones(8)), count=count, width=width, height=height)


def parameters(count: int, seed: int = 0, *, bands: int = 16, size: float = 0.05) -> Parameters:
    rng = np.random.default_rng(seed)

    def normal(*shape: int) -> Float32:
        return rng.normal(size=shape).astype(np.float32)

    return Parameters(
        means=normal(count, 3) * np.float32(0.3),
        quats=normal(count, 4),
        log_scales=np.float32(np.log(size)) + normal(count, 3) * np.float32(0.3),
        opacity_logits=normal(count),
        sh_coeffs=normal(count, bands, 3) * np.float32(0.3),
    )


def state(count: int, seed: int = 0, **settings: Any) -> TrainState:
    """Random parameters with random moments."""
    return TrainState(*(parameters(count, seed + part, **settings) for part in range(3)))


def statistics(gradients: ArrayLike, views: ArrayLike = 1) -> DensificationStatistics:
    """As if each Gaussian had shown these mean gradients in so many views."""
    means = np.asarray(gradients, np.float32)
    counts = np.broadcast_to(np.asarray(views, np.uint32), means.shape)
    return DensificationStatistics(means * counts, counts)


def same_bits(a: TrainState, b: TrainState) -> bool:
    return all(
        np.array_equal(getattr(x, name), getattr(y, name))
        for x, y in zip(vars(a).values(), vars(b).values(), strict=True)
        for name in vars(x)
    )


def colmap_project(
    folder: Path, cameras: Sequence[Camera], points: ArrayLike, images: Iterable[NDArray[Any]] | None = None
) -> Path:
    """Write a COLMAP text model with photographs, called as their cameras: noise, unless given."""
    sizes = [(view.height, view.width, 3) for view in cameras]
    noise: Iterable[NDArray[Any]] = (np.random.default_rng(i).random(size) for i, size in enumerate(sizes))
    means = np.asarray(points, float).reshape(-1, 3)
    colours = np.tile(np.array([200, 100, 50], np.uint8), (len(means), 1))
    write_colmap(folder, cameras, noise if images is None else images, (means, colours))
    listed = folder / "sparse" / "0" / "images.txt"
    for number, camera in enumerate(cameras):
        (folder / "images" / f"{number:05d}.png").rename(folder / "images" / f"{camera.name}.png")
        listed.write_text(listed.read_text().replace(f" {number:05d}.png", f" {camera.name}.png"))
    return folder


def turned_away(camera: Camera) -> Camera:
    """The same place, looking the other way."""
    return replace(camera, viewmat=np.diag([-1.0, 1.0, -1.0, 1.0]) @ camera.viewmat)


def blender_scene(folder: Path, splits: dict[str, list[Camera]], model: Gaussians) -> Path:
    """Write a scene as NeRF's Blender ones: transforms_<split>.json, and photographs of the model that are RGBA."""
    renderer = Renderer(model)
    for split, views in splits.items():
        (folder / split).mkdir(parents=True)
        frames = []
        for i, view in enumerate(views):
            Image.fromarray(cut_out(renderer, view), "RGBA").save(folder / split / f"r_{i}.png")
            pose = np.linalg.inv(view.viewmat) @ np.diag([1.0, -1, -1, 1])
            frames.append({"file_path": f"./{split}/r_{i}", "transform_matrix": pose.tolist()})
        angle = 2 * np.arctan(views[0].width / 2 / views[0].K[0, 0])
        (folder / f"transforms_{split}.json").write_text(json.dumps({"camera_angle_x": angle, "frames": frames}))
    return folder


def cut_out(renderer: Renderer, view: Camera) -> UInt8:
    """Render an RGBA photograph [H,W,4] whose transparency is that of the model."""
    black, white = (renderer.image(view, [shade] * 3).astype(np.float64) for shade in (0, 1))
    alpha = 1 - (white - black).mean(axis=2, keepdims=True)
    colours = np.divide(black, alpha, out=np.zeros_like(black), where=alpha > 0)
    return np.round(np.concatenate([colours, alpha], axis=2).clip(0, 1) * 255).astype(np.uint8)
