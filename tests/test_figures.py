"""The figures of one model and its purification, and where point clouds are looked at from."""

import json
from pathlib import Path

import numpy as np
import pytest

from gspure.cameras import Camera, intrinsics, orbit_cameras
from gspure.figures import gallery, plates, style, viewpoint
from gspure.figures.gallery import CAPTIONS, Purified, draw_model
from gspure.figures.plates import opengl_works
from gspure.images import read_image
from gspure.public_model import PublicModel
from tests.models import gaussians, points_of

RNG = np.random.default_rng(3)
BALL = RNG.normal(size=(400, 3)).astype(np.float32)
needs_gl = pytest.mark.skipif(not opengl_works(), reason="no OpenGL")


@pytest.fixture
def model(monkeypatch: pytest.MonkeyPatch) -> Purified:
    monkeypatch.setattr(gallery, "PICTURE_WIDTH", 120)
    monkeypatch.setattr(gallery, "PAGE_WIDTH", 480)
    monkeypatch.setattr(style, "DPI", 100)
    labels = np.repeat([-1, 0, 1, -1], 100).astype(np.int32)
    weights = np.where(np.arange(400) < 50, 0, RNG.random(400)).astype(np.float32)
    hidden = {"hidden": weights[::-1].copy(), "extracted": lambda public: np.full((30, 40, 3), len(public.model) / 400)}
    return Purified(PublicModel(gaussians(means=BALL, scales=0.1)), labels, weights, **hidden)


@needs_gl
def test_all_figures_have_captions_and_the_same_bytes_again(tmp_path: Path, model) -> None:
    views = orbit_cameras(points_of(BALL, np.ones(400)), count=4, width=32, height=24)
    captions = draw_model(tmp_path / "a", model, views)
    names = ("splats", "weights", "clusters", "kept", "separation", "purification")
    assert [*captions] == [f"{name}.png" for name in names]
    assert json.loads((tmp_path / "a" / CAPTIONS).read_text()) == captions
    assert f"{model.pruned.sum()} of 400 Gaussians are pruned." in captions["kept.png"]
    assert "Pruning removes" in captions["separation.png"]
    tiles = np.split(read_image(tmp_path / "a" / "purification.png")[20:110], 4, axis=1)  # below the titles
    assert np.median(tiles[0]) == 1
    assert np.median(tiles[3]) == pytest.approx(1 - model.pruned.mean(), abs=0.01)
    draw_model(tmp_path / "b", model, views)
    files = {path.name for path in (tmp_path / "a").iterdir()}
    assert files == {*captions, CAPTIONS, "weights.svg"}
    for name in files:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name


def test_without_opengl_clouds_and_broken_figures_are_left_out_with_a_warning(
    tmp_path: Path, model, monkeypatch, capsys
) -> None:
    monkeypatch.setattr(gallery, "opengl_works", lambda: None)
    assert [*draw_model(tmp_path, model)] == ["weights.png"]
    assert capsys.readouterr().err.count("warning: point clouds are not drawn: OpenGL does not work") == 1
    monkeypatch.setattr(gallery, "draw_weights", lambda *_, **__: 1 / 0)
    assert draw_model(tmp_path, model) == {}
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


def test_a_room_is_drawn_from_inside_and_an_object_from_outside() -> None:
    shell = 5 * BALL / np.linalg.norm(BALL, axis=1, keepdims=True)
    dense = np.concatenate([shell, shell[shell[:, 0] > 3] * 0.99])
    right = np.array([[0.0, 0, -1, 0], [0, 1, 0, 0], [1, 0, 0, -0.1], [0, 0, 0, 1]])  # from x = 0.1 along the x axis
    turns = {"left": np.diag([-1.0, 1, -1, 1]), "right": np.eye(4)}
    inside = [Camera(name, 64, 48, intrinsics(50, 50, 32, 24), turn @ right) for name, turn in turns.items()]
    assert viewpoint.choose_camera(dense, inside).name == "right"
    assert viewpoint.choose_camera(dense, orbit_cameras(points_of(dense, np.ones(len(dense))))).name == "overview"
    assert viewpoint.choose_camera(dense, []).name == "overview"
