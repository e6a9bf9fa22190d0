"""Planted messages: the fixture of other tests hides what it says, and only its key reveals it."""

import numpy as np
import pytest

from gspure.cli import main
from gspure.images import read_image
from gspure.public_model import PublicModel
from gspure.scenes.photography import path_cameras
from tests.planted_cases import planted_model

VIEW = path_cameras(3, 32, 24)[0]


@pytest.fixture(scope="module")
def planted():
    return planted_model(gaussians=1200)


@pytest.fixture(scope="module")
def public(planted):
    return planted[0].model


@pytest.fixture(scope="module")
def key(planted):
    return planted[1]


def revealed(model, key):
    return key.gaussians(PublicModel(model), VIEW, "message")


def psnr(a, b):
    return -10.0 * np.log10(np.mean((np.clip(a, 0.0, 1.0) - b) ** 2))


def test_the_message_is_all_of_its_rows_with_private_opacity_and_colour(public, key):
    message, rows = revealed(public, key)
    assert rows.tolist() == np.flatnonzero(key.message_rows).tolist()
    assert message.opacities.min() > 0.89
    assert message.columns("f_dc_0", "f_dc_1", "f_dc_2").tobytes() == key.f_dc.tobytes()


def test_the_scheme_works_on_a_pair_by_its_commands(pair_folder, tmp_path):
    assert main(["embed", "planted", str(pair_folder), "--out", str(tmp_path)]) == 0
    cameras = ["--cameras", str(pair_folder / "cameras.json"), "--split", "test"]
    views = ["--scheme", "planted", "--key", str(tmp_path / "key"), *cameras]
    public = tmp_path / "public" / "point_cloud.ply"
    assert main(["extract", str(public), *views, "--out", str(tmp_path / "message")]) == 0
    shown, hidden = (
        np.mean([psnr(read_image(view), read_image(pair_folder / name / view.name)) for view in views])
        for views in [sorted((tmp_path / "message").glob("*.png"))]
        for name in ("scene", "message")
    )
    assert hidden > shown + 3.0
