"""Planted messages: the fixture of other tests hides what it says, and only its key reveals it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planted import PlantedKey

from gspure.cli import main
from gspure.images import read_image
from gspure.model.gaussians import Gaussians
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


@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 1.0))
def test_the_message_is_exactly_the_surviving_rows_in_any_order(public, key, seed, share):
    rng = np.random.default_rng(seed)
    kept = rng.permutation(len(public))[: round(share * len(public))]
    message, rows = revealed(Gaussians(public.table[kept]), key)
    survivors = kept[key.message_rows[kept]]
    assert kept[rows].tolist() == survivors.tolist()
    place = np.searchsorted(np.flatnonzero(key.message_rows), survivors)
    assert message.columns("opacity")[:, 0].tobytes() == key.opacity[place].tobytes()


def test_a_written_key_reads_back(key, tmp_path):
    key.write(tmp_path)
    back = PlantedKey.read(tmp_path)
    assert all(getattr(back, name).tobytes() == value.tobytes() for name, value in vars(key).items())


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
