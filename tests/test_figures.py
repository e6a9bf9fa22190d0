"""The figures of one model and its purification, and where point clouds are looked at from."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from gspure.cameras import Camera, intrinsics, orbit_cameras
from gspure.figures import gallery, plates, style, viewpoint
from gspure.figures.gallery import CAPTIONS, Purified, draw_model
from gspure.figures.plates import opengl_renderer
from gspure.public_model import PublicModel
from tests.models import gaussians, points_of

RNG = np.random.default_rng(3)
BALL = RNG.normal(size=(400, 3)).astype(np.float32)
needs_gl = pytest.mark.skipif(opengl_renderer() is None, reason="no OpenGL")


@pytest.fixture
def model(monkeypatch: pytest.MonkeyPatch) -> Purified:
    monkeypatch.setattr(gallery, "PICTURE_WIDTH", 120)
    monkeypatch.setattr(gallery, "PAGE_WIDTH", 480)
    monkeypatch.setattr(style, "DPI", 100)
    labels = np.repeat([-1, 0, 1, -1], 100).astype(np.int32)
    weights = np.where(np.arange(400) < 50, 0, RNG.random(400)).astype(np.float32)
    return Purified(PublicModel(gaussians(means=BALL, scales=0.1)), labels, weights, weights[::-1].copy())


@pytest.fixture
def views() -> Sequence[Camera]:
    return orbit_cameras(points_of(BALL, np.ones(400)), count=4, width=32, height=24)


@needs_gl
def test_all_figures_have_captions_and_the_same_bytes_again(tmp_path: Path, model, views) -> None:
    captions = draw_model(tmp_path / "a", model, views)
    assert [*captions] == [
        f"{name}.png" for name in ("splats", "weights", "clusters", "ranks", "kept", "hidden", "purification")
    ]
    assert json.loads((tmp_path / "a" / CAPTIONS).read_text()) == captions
    assert f"{model.pruned.sum()} of 400 Gaussians are pruned." in captions["kept.png"]
    assert "Pruning removes" in captions["purification.png"]
    draw_model(tmp_path / "b", model, views)
    files = {path.name for path in (tmp_path / "a").iterdir()}
    assert files == {*captions, CAPTIONS, "weights.svg", "viewer.json"}
    for name in files:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name


def test_without_opengl_clouds_and_broken_figures_are_left_out_with_a_warning(
    tmp_path: Path, model, monkeypatch, capsys
) -> None:
    monkeypatch.setattr(gallery, "opengl_renderer", lambda: None)
    assert [*draw_model(tmp_path, model)] == ["weights.png"]
    assert capsys.readouterr().err.count("warning: point clouds are not drawn: OpenGL does not work") == 1
    monkeypatch.setattr(gallery, "write_weight_histogram", lambda *_, **__: 1 / 0)
    assert draw_model(tmp_path, model, viewer=False) == {}
    assert "weights.png: not drawn: division by zero" in capsys.readouterr().err


@needs_gl
def test_a_cloud_is_drawn_in_its_colours_where_its_points_are() -> None:
    points = np.array([[0, 0, 4], [1.2, 0.7, 6]], np.float32)
    two = np.array([[200, 0, 0], [0, 0, 200]], np.uint8)
    ahead = Camera("view", 480, 320, intrinsics(400, 400, 180, 200), np.eye(4))
    picture = plates.portraits(points, [two], ahead)[0].astype(int)
    for channel, (x, y, z) in zip((0, 2), points, strict=True):
        others = [c for c in range(3) if c != channel]
        centre = np.argwhere(picture[..., channel] > picture[..., others].max(axis=-1) + 30).mean(axis=0)
        assert centre == pytest.approx([200 + 400 * y / z, 180 + 400 * x / z], abs=1.5)


def looking_at(target: np.ndarray, eye: np.ndarray, name: str = "view") -> Camera:
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross((0, 1, 0), forward)
    right /= np.linalg.norm(right)
    viewmat = np.eye(4)
    viewmat[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    viewmat[:3, 3] = -viewmat[:3, :3] @ eye
    return Camera(name, 64, 48, intrinsics(50, 50, 32, 24), viewmat)


@pytest.mark.parametrize("up", [(0, -1, 0), (0, 0, 1)])
def test_up_is_up_in_an_overview_whatever_the_cameras_call_up(up) -> None:
    axes = viewpoint.world_axes(BALL, orbit_cameras(points_of(BALL, np.ones(400)), count=12, up=up))
    assert axes[1] == pytest.approx(up, abs=0.05)
    high, low = viewpoint.project(np.array([axes[1], -axes[1]]), viewpoint.overview(BALL, axes))[0]
    assert high[1] < low[1]  # rows count downwards


def test_a_room_is_drawn_from_inside_and_an_object_from_outside() -> None:
    shell = 5 * BALL / np.linalg.norm(BALL, axis=1, keepdims=True)
    dense = np.concatenate([shell, shell[shell[:, 0] > 3] * 0.99])
    inside = [looking_at(np.array([x, 0.0, 0.0]), np.array([0.1, 0, 0]), name=f"view_{x}") for x in (-9.0, 9.0)]
    assert viewpoint.choose(dense, inside).name == "view_9.0"
    assert viewpoint.choose(dense, orbit_cameras(points_of(dense, np.ones(len(dense))))).name == "overview"
    assert viewpoint.choose(dense, []).name == "overview"
