"""Pictures of point clouds, and the files that hold the same."""

import base64
import json
import resource
from pathlib import Path

import numpy as np
import pytest

from gspure.cameras import Camera, intrinsics
from gspure.figures import export, portrait, viewpoint
from gspure.figures.clouds import Cloud, cluster_cloud, kept_cloud, rank_cloud
from gspure.figures.portrait import eye_dome
from gspure.figures.probe import gl_problem

RNG = np.random.default_rng(3)
BALL = RNG.normal(size=(400, 3)).astype(np.float32)


needs_gl = pytest.mark.skipif(gl_problem() is not None, reason=f"no OpenGL: {gl_problem()}")
NEAR_AND_FAR = Cloud(
    np.array([[0, 0, 4], [0, 0, 8], [1.2, 0.7, 6]], np.float32),
    np.array([[200, 0, 0], [0, 200, 0], [0, 0, 200]], np.uint8),
    {},
)
ASKEW = Camera("view", 120, 80, intrinsics(100, 100, 45, 50), np.eye(4))


def test_the_nearest_dot_is_visible() -> None:
    image, depth = portrait.draw_dots(NEAR_AND_FAR, ASKEW, 6)
    assert image[50, 45].tolist() == [200, 0, 0]
    assert depth[50, 45] == 4
    assert image[0, 0].tolist() == [255, 255, 255]
    assert np.isinf(depth[0, 0])
    assert image[round(50 + 100 * 0.7 / 6), round(45 + 100 * 1.2 / 6)].tolist() == [0, 0, 200]


def test_eye_dome_darkens_what_stands_behind_an_edge_and_nothing_else() -> None:
    depth = np.full((20, 30), 2.0, np.float32)
    depth[:, 15:] = 4.0
    depth[:5] = np.inf
    image = np.full((20, 30, 3), 200, np.uint8)
    shaded = eye_dome(image, depth, 2)
    assert (shaded[:5] == 200).all()
    assert (shaded[5:, :15] == 200).all()
    assert (shaded[7:18, 15:17] < 150).all()
    assert (shaded[5:, 18:] == 200).all()


@pytest.mark.parametrize("opengl", [False, pytest.param(True, marks=needs_gl)])
def test_a_cloud_is_drawn_in_its_colours_on_white(opengl: bool) -> None:
    camera = viewpoint.fitted(viewpoint.overview(BALL, viewpoint.world_axes(BALL, [])), 480)
    pruned = BALL[:, 0] > 0
    image = portrait.portrait(kept_cloud(BALL, pruned), camera, opengl=opengl).astype(int)
    assert image.shape == (camera.height, camera.width, 3)
    covered = (image < 250).any(axis=-1)
    assert 0.02 < covered.mean() < 0.9
    orange = image[..., 0] > image[..., 2] + 40
    blue = image[..., 2] > image[..., 0] + 10
    assert orange.sum() > 0.1 * covered.sum()
    assert blue.sum() > 0.1 * covered.sum()
    again = portrait.portrait(kept_cloud(BALL, pruned), camera, opengl=opengl)
    assert np.array_equal(image, again)


@needs_gl
def test_both_ways_of_drawing_put_every_dot_in_the_same_place() -> None:
    camera = ASKEW.resized(480, 320)
    pictures = [portrait.portrait(NEAR_AND_FAR, camera, opengl=opengl).astype(int) for opengl in (False, True)]
    for channel in (0, 2):
        others = [c for c in range(3) if c != channel]
        centres = []
        for picture in pictures:
            mine = picture[..., channel] > picture[..., others].max(axis=-1) + 30
            centres.append(np.argwhere(mine).mean(axis=0))
        assert centres[0] == pytest.approx(centres[1], abs=0.6)


def test_a_camera_that_sees_nothing_gives_a_white_picture() -> None:
    away = Camera("view", 20, 10, intrinsics(10, 10, 10, 5), np.diag([-1.0, 1, -1, 1]))
    assert (portrait.portrait(NEAR_AND_FAR, away, opengl=False) == 255).all()


def test_gltf_holds_points_colours_and_scalars_with_up_as_y(tmp_path: Path) -> None:
    weights = RNG.random(400, np.float32)
    cloud = rank_cloud(BALL, np.full(400, -1, np.int32), weights)
    axes = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # z is up
    export.write_gltf(tmp_path / "ranks.gltf", cloud, axes)
    document = json.loads((tmp_path / "ranks.gltf").read_text())
    data = base64.b64decode(document["buffers"][0]["uri"].partition(",")[2])
    assert len(data) == document["buffers"][0]["byteLength"]
    found = {}
    for name, index in document["meshes"][0]["primitives"][0]["attributes"].items():
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        dtype = {5126: "<f4", 5123: "<u2"}[accessor["componentType"]]
        raw = data[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        found[name] = np.frombuffer(raw, dtype).reshape(accessor["count"], -1)
    assert np.array_equal(found["POSITION"], BALL)
    assert np.array_equal(found["_WEIGHT"][:, 0], weights)
    linear = found["COLOR_0"] / 65535
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    assert np.rint(255 * srgb[:, :3]) == pytest.approx(cloud.colours)
    assert (found["COLOR_0"][:, 3] == 65535).all()
    matrix = np.array(document["nodes"][0]["matrix"]).reshape(4, 4).T
    assert (matrix @ [0, 0, 1, 0]).tolist() == [0, 1, 0, 0]
    assert document["accessors"][0]["min"] == BALL.min(axis=0).tolist()


def test_vtp_holds_points_colours_and_scalars(tmp_path: Path) -> None:
    import pyvista as pv

    labels = RNG.integers(-1, 4, 400).astype(np.int32)
    cloud = cluster_cloud(BALL, labels, labels == 2)
    export.write_vtp(tmp_path / "clusters.vtp", cloud)
    mesh = pv.read(tmp_path / "clusters.vtp")
    assert np.array_equal(mesh.points, BALL)
    assert np.array_equal(mesh["rgb"], cloud.colours)
    assert np.array_equal(mesh["cluster"], labels)


def test_points_are_written_whole_or_not_at_all(tmp_path):
    cloud = Cloud(np.zeros((5000, 3), np.float32), np.zeros((5000, 3), np.uint8), {})
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(OSError, match="File too large"):
            export.write_vtp(tmp_path / "a.vtp", cloud)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(tmp_path.iterdir()) == []
