"""Small things to train from, shared by the training tests."""

import json
from pathlib import Path

import numpy as np
from PIL import Image

from gspure.cameras import Camera, intrinsics, orbit_cameras
from gspure.opencl.trainable import DensificationStatistics, Parameters, TrainState
from gspure.renderer import Renderer
from tests.models import points_of


def ring(count=9, width=32, height=24) -> list[Camera]:
    """Views from all sides of the unit cube around the origin."""
    corners = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3), axis=-1).reshape(-1, 3)
    return orbit_cameras(points_of(corners, np.ones(8)), count=count, width=width, height=height)


def parameters(count, seed=0, *, bands=16, size=0.05) -> Parameters:
    rng = np.random.default_rng(seed)

    def normal(*shape):
        return rng.normal(size=shape).astype(np.float32)

    return Parameters(
        means=normal(count, 3) * np.float32(0.3),
        quats=normal(count, 4),
        log_scales=np.float32(np.log(size)) + normal(count, 3) * np.float32(0.3),
        opacity_logits=normal(count),
        sh_coeffs=normal(count, bands, 3) * np.float32(0.3),
    )


def state(count, seed=0, **settings) -> TrainState:
    """Random parameters with random moments."""
    return TrainState(*(parameters(count, seed + part, **settings) for part in range(3)))


def statistics(gradients, views=1) -> DensificationStatistics:
    """As if each Gaussian had shown these mean gradients in so many views."""
    gradients = np.asarray(gradients, np.float32)
    views = np.broadcast_to(np.asarray(views, np.uint32), gradients.shape)
    return DensificationStatistics(gradients * views, views)


def same_bits(a: TrainState, b: TrainState) -> bool:
    return all(
        np.array_equal(getattr(x, name), getattr(y, name))
        for x, y in zip(vars(a).values(), vars(b).values(), strict=True)
        for name in vars(x)
    )


def colmap_project(folder: Path, cameras, points, images=None) -> Path:
    """Write a COLMAP text model with photographs: noise, unless given."""
    sparse = folder / "sparse" / "0"
    sparse.mkdir(parents=True)
    (folder / "images").mkdir()
    first = cameras[0]
    lens = " ".join(str(first.K[place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2)))
    (sparse / "cameras.txt").write_text(f"1 PINHOLE {first.width} {first.height} {lens}\n")
    lines = []
    for i, camera in enumerate(cameras):
        w, x, y, z = quaternion(camera.viewmat[:3, :3])
        t = " ".join(map(repr, camera.viewmat[:3, 3].tolist()))
        lines.append(f"{i + 1} {w!r} {x!r} {y!r} {z!r} {t} 1 {camera.name}.png\n\n")
        noise = np.random.default_rng(i).integers(256, size=(camera.height, camera.width, 3), dtype=np.uint8)
        pixels = noise if images is None else np.round(images[i].clip(0, 1) * 255).astype(np.uint8)
        Image.fromarray(pixels).save(folder / "images" / f"{camera.name}.png")
    (sparse / "images.txt").write_text("".join(lines))
    rows = (f"{i} {x!r} {y!r} {z!r} 200 100 50 0.5\n" for i, (x, y, z) in enumerate(np.asarray(points, float).tolist()))
    (sparse / "points3D.txt").write_text("".join(rows))
    return folder


def quaternion(rotation):
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat().tolist()
    return w, x, y, z


def turned_away(camera: Camera) -> Camera:
    """The same place, looking the other way."""
    viewmat = np.diag([-1.0, 1.0, -1.0, 1.0]) @ camera.viewmat
    K = intrinsics(*(camera.K[at] for at in ((0, 0), (1, 1), (0, 2), (1, 2))))
    return Camera(camera.name, camera.width, camera.height, K, viewmat, camera.image)


def blender_scene(folder: Path, splits: dict[str, list[Camera]], model, *, suffix=".png") -> Path:
    """Write a scene as NeRF's Blender ones: transforms_<split>.json, and photographs of the model that are RGBA."""
    renderer = Renderer(model)
    for split, views in splits.items():
        (folder / split).mkdir(parents=True)
        frames = []
        for i, view in enumerate(views):
            Image.fromarray(cut_out(renderer, view), "RGBA").save(folder / split / f"r_{i}{suffix}")
            pose = np.linalg.inv(view.viewmat) @ np.diag([1.0, -1, -1, 1])
            frames.append({"file_path": f"./{split}/r_{i}", "transform_matrix": pose.tolist()})
        angle = 2 * np.arctan(views[0].width / 2 / views[0].K[0, 0])
        content = {"camera_angle_x": angle, "frames": frames}
        (folder / f"transforms_{split}.json").write_text(json.dumps(content))
    return folder


def cut_out(renderer: Renderer, view: Camera):
    """Render an RGBA photograph [H,W,4] whose transparency is that of the model."""
    black, white = (renderer.image(view, [shade] * 3).astype(np.float64) for shade in (0, 1))
    alpha = 1 - (white - black).mean(axis=2, keepdims=True)
    colours = np.divide(black, alpha, out=np.zeros_like(black), where=alpha > 0)
    return np.round(np.concatenate([colours, alpha], axis=2).clip(0, 1) * 255).astype(np.uint8)
