"""Infinities with a meaning, logits of opacity 0 or 1 and logarithms of a size of 0, act like finite numbers."""

import numpy as np
import pytest

from gspure.attacks import BUILT_IN, NotApplicable, find_attack
from gspure.model import read_model, require_finite, write_model
from gspure.model.finite import drawable, undrawable_rows
from gspure.public_model import PublicModel
from gspure.renderer import Renderer
from gspure.schemes.matching import adaptive_matches
from gspure.surface.distances import mesh_distances
from gspure.surface.meshing import Mesh
from gspure_torch.keyss.key import NetworkKey
from gspure_torch.keyss.network import fresh, random_key
from tests.attack_cases import measurements
from tests.models import blobs, camera, tilted_camera

COUNT = 60
VIEWS = [camera(name="a"), tilted_camera(name="b")]


def model(certain=20.0, nothing=-200.0):
    """Opaque, invisible, flat, needle-like and point-like rows among others; by default of finite numbers."""
    rows = blobs(COUNT)
    for name, part, value in (
        ("opacity", slice(0, 20, 2), certain),
        ("opacity", slice(1, 7, 2), nothing),
        ("scale_2", slice(4, 12), nothing),
        ("scale_1", slice(8, 12), nothing),
        ("scale_0", slice(10, 12), nothing),
    ):
        rows.table[name][part] = value
    return rows


FINITE = model()
INFINITE = model(np.inf, -np.inf)
MODELS = (FINITE, INFINITE)


def same(a, b):
    """Check that two models mean the same to the last bit."""
    for name in ("means", "quats", "scales", "opacities", "sh_coeffs"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


@pytest.mark.filterwarnings("error")
def test_they_are_drawn_and_measured_as_the_finite_numbers_they_stand_for(device, style, energy, capsys):
    assert drawable(INFINITE, "m") is INFINITE
    require_finite(INFINITE, "m")
    finite, infinite = (Renderer(model, device, energy=energy, style=style) for model in MODELS)
    for view in VIEWS:
        assert finite.image(view).tobytes() == infinite.image(view).tobytes()
        assert finite.contributions(view).tobytes() == infinite.contributions(view).tobytes()
    assert {0, 2}.intersection(infinite.contributions(VIEWS[0])["index"].tolist())
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("attack", BUILT_IN, ids=lambda attack: attack.name)
def test_attacks_do_the_same_to_them(device, attack):
    for package in attack.packages:
        pytest.importorskip(package)
    settings = {"cameras": VIEWS, "device": device}
    if "iterations" in attack.settings:
        settings["iterations"] = 3
    if attack.name == "quantize":
        settings["attributes"] = "colour"  # the extremes of other attributes differ
    try:
        pair = [attack.apply(PublicModel(model), measurements(COUNT), **settings) for model in MODELS]
    except NotApplicable:
        return
    same(pair[0].model, pair[1].model)
    assert not len(undrawable_rows(pair[1].model))
    np.testing.assert_array_equal(pair[0].rows, pair[1].rows)


@pytest.mark.parametrize("bits", [1, 8, 16])
def test_quantization_keeps_them_and_spans_the_others(bits):
    settings = {"bits": bits, "attributes": "opacity,scale"}
    after = find_attack("quantize").apply(INFINITE, measurements(COUNT), **settings).model
    for certain, meaning in ((np.inf, 1), (-np.inf, 0)):
        assert set(after.opacities[INFINITE.table["opacity"] == certain]) == {meaning}
    assert not after.scales[INFINITE.log_scales == -np.inf].any()
    others = np.isfinite(INFINITE.log_scales)
    assert np.abs(after.log_scales[others] - INFINITE.log_scales[others]).max() < 4 / bits


@pytest.mark.parametrize("name", ["m.ply", "m.compressed.ply", "m.spz"])
def test_they_survive_in_files(tmp_path, name):
    if name != "m.ply":
        pytest.importorskip("gsply", reason="gspure[compression] is not installed")
    write_model(tmp_path / f"finite{name}", FINITE)
    write_model(tmp_path / f"infinite{name}", INFINITE)
    finite = read_model(tmp_path / f"finite{name}")
    infinite = read_model(tmp_path / f"infinite{name}")
    same(finite, infinite)
    if name == "m.ply":
        assert infinite.table.tobytes() == INFINITE.table.tobytes()


def test_schemes_and_distances_read_finite_numbers_from_them(device):
    rng = np.random.default_rng(0)
    key = NetworkKey(random_key(rng), fresh(rng))
    finite, infinite = (key.gaussians(PublicModel(model), VIEWS[0], "message")[0] for model in MODELS)
    same(finite, infinite)
    assert (adaptive_matches(INFINITE, INFINITE) >= 0).mean() > 0.9
    assert np.isfinite(mesh_distances(INFINITE, Mesh(np.eye(3), np.array([[0, 1, 2]])))).all()


@pytest.mark.parametrize(
    ("name", "value"),
    [("opacity", np.nan), ("scale_1", np.inf), ("scale_1", np.nan), ("x", -np.inf), ("rot_0", np.inf)],
)
def test_other_infinities_have_no_meaning(capsys, name, value):
    rows = INFINITE.with_columns({})
    rows.table[name][[3, 30]] = value
    assert undrawable_rows(rows).tolist() == [3, 30]
    drawn = drawable(rows, "m")
    assert drawn.opacities[[3, 30]].tolist() == [0, 0]
    assert not len(undrawable_rows(drawn))
    assert "2 of 60 rows" in capsys.readouterr().err
