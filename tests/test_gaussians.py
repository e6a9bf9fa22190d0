import numpy as np
import pytest

from gspure.errors import InputError
from gspure.model import Gaussians, require_finite
from gspure.model.finite import non_finite_rows
from gspure.model.summary import kind
from tests.models import blobs


def table_of(columns, rows=3):
    """A float32 table whose entry in row r, column c is 100 r + c."""
    table = np.empty(rows, [(name, "<f4") for name in columns])
    for c, name in enumerate(columns):
        table[name] = 100 * np.arange(rows) + c
    return table


@pytest.mark.parametrize(
    ("comments", "mode"),
    [
        ([], ""),
        (["Exported from Brush", "SplatRenderMode: mip"], "mip"),
        (["SplatRenderMode: mip", "SplatRenderMode: default"], ""),
        (["postshot.anti_aliasing=1"], "mip"),
    ],
)
def test_the_last_comment_about_the_render_mode_names_it(comments, mode):
    assert Gaussians(blobs(2).table, tuple(comments)).render_mode == mode


@pytest.mark.parametrize("degree", [0, 1, 3])
def test_f_rest_is_channel_major(degree):
    per_channel = (degree + 1) ** 2 - 1
    columns = [f"f_rest_{i}" for i in range(3 * per_channel)] + ["f_dc_0", "f_dc_1", "f_dc_2"]
    model = Gaussians(table_of(columns))
    assert model.sh_degree == degree
    assert model.sh_coeffs.shape == (3, per_channel + 1, 3)
    for channel in range(3):
        np.testing.assert_array_equal(model.sh_coeffs[:, 0, channel], model.table[f"f_dc_{channel}"])
        for j in range(1, per_channel + 1):
            stored = model.table[f"f_rest_{channel * per_channel + j - 1}"]
            np.testing.assert_array_equal(model.sh_coeffs[:, j, channel], stored)


@pytest.mark.parametrize("degree", [0, 3])
def test_parameters_of_gsplat_mean_the_same_and_return_unchanged(degree):
    model = blobs(7, sh_degree=degree)
    splats = model.to_gsplat()
    colours = np.concatenate([splats["sh0"], splats["shN"]], axis=1)  # as gsplat draws them
    np.testing.assert_array_equal(colours, model.sh_coeffs)
    np.testing.assert_allclose(np.exp(splats["scales"]), model.scales, rtol=1e-6)
    np.testing.assert_allclose(1 / (1 + np.exp(-splats["opacities"])), model.opacities, rtol=1e-6)
    assert Gaussians.from_gsplat(splats).columns(*model.names).tobytes() == model.columns(*model.names).tobytes()


@pytest.mark.parametrize(("name", "shape"), [("opacities", (7, 1)), ("shN", (7, 24, 3)), ("scales", None)])
def test_parameters_of_gsplat_that_are_missing_or_of_another_shape_are_refused(name, shape):
    splats = blobs(7).to_gsplat()
    if shape:
        splats[name] = np.zeros(shape)
    else:
        del splats[name]
    with pytest.raises(InputError, match=f"^splats: {name}: expected "):
        Gaussians.from_gsplat(splats)


@pytest.mark.parametrize(("name", "value"), [("x", np.nan), ("f_dc_1", np.inf), ("f_rest_44", -np.inf)])
def test_a_number_that_is_not_finite_is_refused_by_property_count_and_row(name, value):
    column = np.ones(5000)
    column[[4100, 4200]] = value
    with pytest.raises(InputError, match=f"{name}: .* in 2 of 5000 rows, first in row 4100"):
        require_finite(blobs(5000).with_columns({name: column}), "model.ply")


def test_columns_that_are_not_rendered_may_hold_anything():
    model = blobs(3).with_columns({"nx": np.full(3, np.nan)})
    require_finite(model, "model.ply")
    assert non_finite_rows(model, model.table.dtype.names)["nx"].tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("columns", "name"),
    [
        (["x", "f_dc_0"], "vanilla 3DGS"),
        (["x", "opacity", "semantic_0", "semantic_1"], "GS-Hider"),
        (["x", "f_offset_0", "f_anchor_feat_0", "opacity"], "Scaffold-GS"),
        (["x", "f_dc_0", "filter_3D"], "GOF"),
        (["x", "opacity"], "unknown"),
    ],
)
def test_a_scheme_is_recognized_by_its_columns(columns, name):
    model = Gaussians(table_of(columns))
    assert kind(model).startswith(name)
    assert model.has_anchors == (name == "Scaffold-GS")


@pytest.mark.parametrize("rows", [slice(3), [2, 0], np.array([False, True, True, False, False]), 4, -1])
def test_rows_are_selected_as_in_an_array(rows):
    model = blobs(5).with_comment("kept")
    assert model[rows].table.tobytes() == np.atleast_1d(model.table[rows]).tobytes()
    assert model[rows].comments == ("kept",)
