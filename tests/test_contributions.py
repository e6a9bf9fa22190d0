"""Contributions of a view: the energy center_ray, conservation of light, rows smaller than a pixel; and their store."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gspure import public_model
from gspure.arrays import save_array
from gspure.constants import ALPHA_MAX
from gspure.errors import InputError
from gspure.method import contributions
from gspure.method.contributions import contribute, contribution_key, read_contributions
from gspure.method.subpixel import subpixel_rows
from gspure.method.weights import accumulate
from gspure.opencl.passes import require_conservation
from gspure.public_model import PublicModel
from gspure.renderer import CONTRIBUTION, Renderer
from tests.models import AWKWARD, blobs, camera, gaussians, joined, subpixel, tilted_camera
from tests.reference.blending import centre_contributions
from tests.reference.footprint import extents
from tests.reference.projection import project


@pytest.fixture
def renderer(monkeypatch):
    """A stand-in for the renderer: it remembers which views it was asked for, and can fail at one of them."""

    def contributions(view):
        if view.name == counting.failing_view:
            raise KeyboardInterrupt
        counting.asked.append(view.name)
        return np.array([(3, 1.0, 0.5, 3)], CONTRIBUTION)

    counting = SimpleNamespace(asked=[], failing_view=None, contributions=contributions)
    monkeypatch.setattr(public_model, "Renderer", lambda *_, **__: counting)
    return counting


def views(count=4):
    return [camera(32, 24, name=f"view_{i}") for i in range(count)]


@pytest.mark.parametrize("column", ["x", "rot_3", "scale_1", "opacity", "f_dc_0"])
def test_geometry_and_opacity_of_any_gaussian_are_in_the_key_and_colour_is_not(column):
    model = blobs(5)
    edited = model.table[column].copy()
    edited[-1] = np.nextafter(edited[-1], np.float32(9))
    same = PublicModel(model.with_columns({column: edited})).geometry_digest() == PublicModel(model).geometry_digest()
    assert same == (column == "f_dc_0")


def test_the_energy_the_device_and_the_rendering_code_are_in_the_key(monkeypatch):
    keys = {contribution_key("geometry", camera(), energy, device) for energy in ("ray", "ewa") for device in "ab"}
    monkeypatch.setattr(contributions, "rendering_digest", lambda: "edited kernels")
    keys |= {contribution_key("geometry", camera(), "ray", "a")}
    assert len(keys) == 5


def test_views_that_an_interrupted_job_left_and_edited_ones_are_computed_alone(tmp_path, renderer):
    renderer.failing_view = "view_2"
    with pytest.raises(KeyboardInterrupt):
        contribute(PublicModel(blobs(5)), views(), tmp_path)
    assert sorted(path.name.split(".")[0] for path in tmp_path.glob("*.npy")) == ["view_0", "view_1"]
    renderer.failing_view = None
    renderer.asked.clear()
    contribute(PublicModel(blobs(5)), views(), tmp_path)
    assert renderer.asked == ["view_2", "view_3"]
    edited = views()
    viewmat = edited[1].viewmat.copy()
    viewmat[2, 3] += 1e-9
    edited[1] = replace(edited[1], viewmat=viewmat)
    contribute(PublicModel(blobs(5)), edited, tmp_path)
    assert renderer.asked == ["view_2", "view_3", "view_1"]


DAMAGES = {"cut": lambda content: content[:-5], "another dtype": lambda content: content.replace(b"pixels", b"texels")}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_file_counts_as_missing(tmp_path, renderer, damage):
    path = contribute(PublicModel(blobs(5)), views(), tmp_path)["view_2"]
    good = path.read_bytes()
    path.write_bytes(damage(good))
    with pytest.raises(InputError, match=path.name):
        read_contributions(path)
    renderer.asked.clear()
    contribute(PublicModel(blobs(5)), views(), tmp_path)
    assert renderer.asked == ["view_2"]
    assert path.read_bytes() == good


def test_a_row_that_the_model_does_not_have_is_refused_by_file_row_and_range(tmp_path):
    records = np.array([(0, 1.5, 0.5, 4), (3, 0.25, 0.25, 1), (4, 2.0, 0.99, 9)], CONTRIBUTION)
    save_array(tmp_path / "view_0.key.npy", records)
    assert len(read_contributions(tmp_path / "view_0.key.npy", 5)) == 3
    with pytest.raises(InputError, match=r"view_0\.key\.npy: index: expected rows 0 to 3 of the model, found row 4"):
        read_contributions(tmp_path / "view_0.key.npy", 4)
    save_array(tmp_path / "view_1.key.npy", records[::-1])
    with pytest.raises(InputError, match="ascending"):
        read_contributions(tmp_path / "view_1.key.npy", 5)


def measured(model, view, device=None, style=None, **budget):
    records = Renderer(model, device, energy="center_ray", style=style, **budget).contributions(view)
    assert (np.diff(records["index"].astype(int)) > 0).all()
    assert (records["pixels"] == 1).all()
    assert (records["sum"] == records["max"]).all()
    contributions = np.zeros(len(model))
    contributions[records["index"]] = records["sum"]
    return contributions


def assert_agrees(model, view, device, style):
    expected, margins = centre_contributions(model, view)
    error = np.abs(measured(model, view, device, style) - expected)
    assert (error[margins > 1e-3] < 2e-5).all(), error[margins > 1e-3].max()


@pytest.mark.parametrize("case", AWKWARD)
def test_awkward_models_agree_with_the_reference(device, style, case):
    assert_agrees(*AWKWARD[case](), device, style)


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**31), count=st.integers(1, 80), size=st.integers(1, 70))
def test_random_scenes_agree(device, style, seed, count, size):
    assert_agrees(blobs(count, seed % 1000), tilted_camera(size, size + 3), device, style)


@pytest.mark.parametrize("scales", [1e-7, 1e-9, 1e-13, (1e-13, 1e-13, 1.0)])
def test_the_thinnest_gaussians_contribute_what_others_let_through(device, style, scales):
    """Rounded to float32, the ray through a centre misses Gaussians that are thinner than 1e-7 of their depth."""
    x, y = np.meshgrid(np.linspace(-1.1, 1.2, 6), np.linspace(-0.9, 0.8, 5))
    means = np.column_stack([x.ravel(), y.ravel(), np.linspace(3, 4, x.size)])
    model, view = gaussians(means=means, scales=scales, opacities=0.8), camera()
    np.testing.assert_allclose(measured(model, view, device, style), centre_contributions(model, view)[0], rtol=1e-5)


def test_bands_styles_and_a_second_run_give_the_same_bits(device):
    model, view = blobs(300, 5), tilted_camera()
    runs = [measured(model, view, device, s, entry_budget=b) for s in ("cpu", "gpu") for b in (1 << 26, 500)]
    assert (runs[0] == runs[1]).all()
    assert (runs[2] == runs[3]).all()
    np.testing.assert_allclose(runs[0], runs[2], rtol=1e-4, atol=1e-6)
    assert 0 < runs[0].max() <= np.float32(ALPHA_MAX)


def sound():
    """Rows 3 and 7 in an image of 2 x 2 pixels."""
    contributions = np.array([(3, 1.25, 0.75, 2), (7, 0.5, 0.5, 1)], CONTRIBUTION)
    return contributions, np.array([[0.25, 0.5], [0.5, 1.0]], np.float32)


@pytest.mark.parametrize("factor", [1 + 1e-3, 1 - 1e-3])
def test_violated_conservation_of_light_is_detected(factor):
    contributions, transmittance = sound()
    require_conservation("front", contributions, transmittance)
    require_conservation("front", np.zeros(0, CONTRIBUTION), np.ones((2, 2), np.float32))
    contributions["sum"] *= np.float32(1 + 2e-5)
    require_conservation("front", contributions, transmittance)
    contributions["sum"] *= np.float32(factor)
    with pytest.raises(InputError, match=r"front.*sum of contributions"):
        require_conservation("front", contributions, transmittance)


def test_the_renderer_checks_every_view(device, monkeypatch):
    """As if the device lost the contributions of a band."""
    renderer, view = Renderer(blobs(30, 1), device, energy="ray"), camera(name="front")
    renderer.contributions(view)
    monkeypatch.setattr("gspure.opencl.passes.sum_slots", lambda *_: None)
    with pytest.raises(InputError, match=r"front.*sum of contributions"):
        renderer.contributions(view)


def weights_of(model, views):
    renderer = Renderer(model, energy="ray")
    return accumulate([renderer.contributions(view) for view in views], len(model))


def test_rows_smaller_than_a_pixel_in_every_view_are_found():
    model, view = subpixel()
    far = camera(focal=30.0, name="far")
    weights = weights_of(model, [view, far])
    found = subpixel_rows(model, weights, [view, far])
    boxes = extents(project(model, view, "ray"))
    areas = np.empty(len(model))
    areas[project(model, view, "ray").rows] = np.pi / 4 * (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
    assert 20 < len(found.rows) < len(model)
    assert (weights[found.rows] == 0).all()
    assert (areas[found.rows] < 1.01).all()  # of round Gaussians the box is that of a circle
    inside = (boxes[:, :2] > 0).all(axis=1) & (boxes[:, 2:] < [view.width, view.height]).all(axis=1)
    rows = project(model, view, "ray").rows[inside]
    assert set(rows[(areas[rows] < 0.99) & (weights[rows] == 0)]) <= set(found.rows)


def test_half_of_the_small_rows_cover_a_pixel_at_the_stated_magnification():
    model, view = subpixel()
    found = subpixel_rows(model, weights_of(model, [view]), [view])
    finer = view.resized(*(int(np.ceil(found.magnification * side)) for side in (view.width, view.height)))
    weights = np.ones(len(model))
    weights[found.rows] = 0
    still = subpixel_rows(model, weights, [finer])
    assert abs(len(still.rows) - len(found.rows) / 2) <= 0.1 * len(found.rows)
    assert str(finer.width) in found.line(len(model), view.width)


def test_invisible_gaussians_have_no_weight():
    wall = gaussians(means=[[0, 0, 1]], scales=[50.0, 50.0, 0.01], opacities=0.99)
    hidden = gaussians(means=[[0, 0, 4], [0, 0, -4], [900, 0, 4]], scales=0.5)
    faint = gaussians(means=[[0.01, 0.01, 0.5]], scales=1e-6, opacities=0.003)
    model = joined(wall, hidden, faint)
    assert subpixel_rows(model, np.array([1.0, 0, 0, 0, 0]), [camera()]) is None


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e-3])
@pytest.mark.parametrize("field", ["sum", "max"])
def test_an_invalid_contribution_is_reported_with_view_and_row(field, value):
    contributions, transmittance = sound()
    contributions[field][1] = value
    with pytest.raises(InputError, match=rf"front.*{np.float32(value)} in row 7"):
        require_conservation("front", contributions, transmittance)


@pytest.mark.parametrize("value", [np.nan, 8.9e31, -0.01])
def test_an_invalid_transmittance_is_reported_with_its_pixel(value):
    contributions, transmittance = sound()
    transmittance[1, 0] = value
    with pytest.raises(InputError, match=r"front.*transmittance.*column 0, line 1"):
        require_conservation("front", contributions, transmittance)
