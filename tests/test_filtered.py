"""The 3-D filter of Mip-Splatting and GOF: models are drawn as their trainers draw them."""

import numpy as np
import pytest

from gspure.cameras import write_cameras
from gspure.cli import main
from gspure.images import read_image
from gspure.model import Gaussians, read_model, write_model
from gspure.model.filtered import FILTER, filtered
from gspure.model.finite import drawable, undrawable_rows
from gspure.model.rotations import rotation_matrices
from gspure.renderer import Renderer
from tests.models import blobs, camera, with_column

ROWS = 60
SIZES = np.linspace(0, 0.3, ROWS)


def covariances(of: Gaussians) -> np.ndarray:
    turns = rotation_matrices(of.quats)
    return np.einsum("kij,kj,klj->kil", turns, of.scales.astype(np.float64) ** 2, turns)


def test_a_filter_widens_gaussians_and_keeps_their_mass():
    stored = with_column(blobs(ROWS), FILTER, SIZES)
    drawn = filtered(stored)
    expected = covariances(stored) + SIZES[:, None, None] ** 2 * np.eye(3)
    np.testing.assert_allclose(covariances(drawn), expected, rtol=1e-4, atol=1e-6)
    mass = [model.opacities * np.sqrt(np.linalg.det(covariances(model))) for model in (stored, drawn)]
    np.testing.assert_allclose(*mass, rtol=1e-3)
    assert not drawn.table[FILTER].any()
    assert drawn.table[0] == stored.table[0], "a filter of 0 changes nothing"
    assert filtered(drawn) is drawn


@pytest.mark.parametrize(("scale", "size"), [(-400.0, 1e-3), (80.0, 1e30), (-3.0, 3e38), (-3.0, 1e-38)])
def test_extreme_filters_leave_finite_numbers(scale, size):
    columns = {"scale_0": np.full(3, scale)}
    drawn = filtered(with_column(blobs(3).with_columns(columns), FILTER, size))
    assert not len(undrawable_rows(drawn))


def test_a_filter_that_is_not_finite_makes_its_row_invisible():
    drawn = drawable(with_column(blobs(ROWS), FILTER, np.where(np.arange(ROWS) == 7, np.nan, 0.1)), "model")
    assert np.flatnonzero(drawn.opacities == 0).tolist() == [7]
    assert np.isfinite(drawn.table[FILTER]).all()


def test_commands_draw_and_attack_what_the_filter_makes_of_a_model(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_cameras("cameras.json", [camera(40, 30, name=f"view_{i}") for i in range(9)])
    stored = with_column(blobs(ROWS), FILTER, 0.2)
    write_model("stored.ply", stored)
    write_model("fused.ply", filtered(stored))
    assert main(["attack", "unattacked", "--model", "stored.ply", "--out", "attacked.ply"]) == 0
    assert read_model("stored.ply").table.tobytes() == stored.table.tobytes()
    for name in ("stored", "fused", "attacked"):
        assert main(f"render {name}.ply --cameras cameras.json --split test --out {name}".split()) == 0
    images = [read_image(f"{name}/view_0.png") for name in ("stored", "fused", "attacked")]
    assert all((image == images[0]).all() for image in images)
    write_model("plain.ply", blobs(ROWS))
    assert main(["render", "plain.ply", "--cameras", "cameras.json", "--split", "test", "--out", "plain"]) == 0
    assert np.abs(read_image("plain/view_0.png") - images[0]).max() > 0.05


def test_a_render_mode_that_is_not_applied_is_named(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_cameras("cameras.json", [camera(40, 30)])
    write_model("model.ply", blobs(9).with_comment("postshot.anti_aliasing=1"))
    assert main(["render", "model.ply", "--cameras", "cameras.json", "--out", "renders"]) == 0
    assert "render mode mip, which gspure does not apply" in capsys.readouterr().err


def test_columns_that_change_nothing_are_named(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_cameras("cameras.json", [camera(40, 30)])
    columns = {"beta": ("beta", np.arange(9)), "constant": ("state", 1), "filter": (FILTER, np.arange(9))}
    for name, column in columns.items():
        model = with_column(blobs(9), *column)
        write_model(f"{name}.ply", model)
        assert main(f"render {name}.ply --cameras cameras.json --out {name}".split()) == 0
        assert ("have no effect on renders: beta\n" in capsys.readouterr().err) == (name == "beta")


def test_a_renderer_applies_the_filter():
    stored = with_column(blobs(ROWS), FILTER, SIZES)
    image = Renderer(stored).image(camera())
    np.testing.assert_array_equal(image, Renderer(filtered(stored)).image(camera()))
    assert not np.array_equal(image, Renderer(blobs(ROWS)).image(camera()))
