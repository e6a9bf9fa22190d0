"""The 3-D filter of Mip-Splatting and GOF: models are drawn as their trainers draw them."""

import numpy as np

from gspure.cli import main
from gspure.images import read_image
from gspure.model import read_model, write_model
from gspure.model.finite import FILTER, filtered
from tests.models import blobs, covariances, with_column

ROWS = 60
SIZES = np.linspace(0, 0.3, ROWS)


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


def test_commands_draw_and_attack_what_the_filter_makes_of_a_model(asset):
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
