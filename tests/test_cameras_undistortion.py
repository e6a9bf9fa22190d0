"""Photographs without lens distortion."""

from pathlib import Path

import numpy as np
import pytest

from gspure.cameras import Camera, read_cameras
from gspure.cameras.reading import read_lenses
from gspure.cameras.undistortion import undistort
from gspure.cli import main
from gspure.errors import InputError
from gspure.images import read_image, write_image
from gspure.model.ply import read_point_ply
from tests.models import camera
from tests.test_cameras_colmap import LENSES, text, written

LENSES_OF_ALL_KINDS = {
    "barrel": (-0.2, 0.05),
    "pincushion": (0.15,),
    "tangential": (0.02, -0.01, 0.004, -0.006),
    "all": (-0.1, 0.03, 0.002, -0.003, 0.01, 0.05, 0.01, 0.002),
}


def pattern(x, y):
    """A smooth picture of a plane at distance 1, three channels [N,3]."""
    return 0.5 + 0.4 * np.stack([np.sin(9 * x) * np.cos(8 * y), np.cos(11 * x + 3 * y), np.sin(7 * y - 5 * x)], -1)


def seen_through(lens: Camera) -> np.ndarray:
    """What a lens shows of the plane: the inverse of its distortion by fixed-point iteration."""
    rows, columns = np.indices((lens.height, lens.width)) + 0.5
    target = (np.stack([columns, rows], -1) - lens.K[:2, 2]) / lens.K[[0, 1], [0, 1]]
    k1, k2, p1, p2, k3, k4, k5, k6 = np.pad(lens.distortion, (0, 8 - len(lens.distortion)))
    undistorted = target.copy()
    for _ in range(60):
        x, y = np.moveaxis(undistorted, -1, 0)
        r2 = x**2 + y**2
        radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
        shift = np.stack([2 * p1 * x * y + p2 * (r2 + 2 * x**2), p1 * (r2 + 2 * y**2) + 2 * p2 * x * y], -1)
        undistorted = (target - shift) / radial[..., None]
    return pattern(*np.moveaxis(undistorted, -1, 0))


def taken(folder: Path, distortion, **settings) -> Camera:
    view = camera(96, 72, focal=80.0, principal=(50.0, 33.0), **settings)
    lens = Camera(view.name, view.width, view.height, view.K, view.viewmat, folder / "photo.png", distortion)
    write_image(folder / "photo.png", seen_through(lens))
    return lens


@pytest.mark.parametrize("kind", LENSES_OF_ALL_KINDS)
def test_a_photograph_becomes_that_of_a_pinhole(tmp_path, kind):
    lens = taken(tmp_path, LENSES_OF_ALL_KINDS[kind])
    (pinhole,) = undistort([lens], tmp_path / "flat", tmp_path)
    assert (pinhole.distortion, pinhole.width, pinhole.height) == ((), lens.width, lens.height)
    rows, columns = np.indices((72, 96)) + 0.5
    x = (columns - pinhole.K[0, 2]) / pinhole.K[0, 0]
    y = (rows - pinhole.K[1, 2]) / pinhole.K[1, 1]
    assert np.abs(read_image(pinhole.image) - pattern(x, y)).max() < 0.01
    assert np.abs(seen_through(lens) - pattern(x, y)).max() > 0.05


def test_the_photograph_just_fills_the_image(tmp_path):
    for k1, least, largest in ((-0.2, 0.9, 0.99), (0.15, 1.01, 1.1)):
        (pinhole,) = undistort([taken(tmp_path, (k1,))], tmp_path / "flat", tmp_path)
        assert least < pinhole.K[0, 0] / 80 < largest
    (identical,) = undistort([taken(tmp_path, ())], tmp_path / "flat", tmp_path)
    np.testing.assert_allclose(identical.K[0], [80, 0, 50], atol=1e-6)


def test_a_distortion_too_strong_for_a_pinhole_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"view\.distortion"):
        undistort([Camera(**vars(taken(tmp_path, ())) | {"distortion": (-1e9,)})], tmp_path / "flat", tmp_path)


def capture(folder: Path) -> Path:
    lenses = [(7, "OPENCV", 96, 72, (80.0, 80.0, 50.0, 33.0, -0.2, 0.05, 0.0, 0.0)), LENSES[1]]
    written(folder / "sparse" / "0", text(lenses=lenses))
    (folder / "images").mkdir()
    for view in read_lenses(folder):
        view.image.parent.mkdir(parents=True, exist_ok=True)
        write_image(view.image.with_suffix(".png"), np.full((view.height, view.width, 3), 0.5))
        view.image.with_suffix(".png").rename(view.image)
    return folder


def test_the_command_writes_a_capture_without_distortion(tmp_path):
    source = capture(tmp_path / "capture")
    out = tmp_path / "flat" / "cameras.json"
    assert main(["cameras", str(source), "--undistort", "--out", str(out)]) == 0
    views = read_cameras(tmp_path / "flat")
    assert [view.name for view in views] == [view.name for view in read_lenses(source)]
    assert all(view.image.parent == tmp_path / "flat" / "images" and view.image.is_file() for view in views)
    assert len(read_point_ply(tmp_path / "flat" / "points3D.ply")[0]) > 0
