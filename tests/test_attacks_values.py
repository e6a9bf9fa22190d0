"""Attacks that change stored values: which columns, by how much, and where there is nothing to change."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.attacks import Measurements, find_attack
from gspure.attacks.geometry import radius
from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.public_model import PublicModel
from tests.attack_cases import KINDS, anchors, changed, features, public, unhurried
from tests.models import blobs

COUNT = 30
GEOMETRY = {"scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}
COLOURS = {
    "harmonics": {f"f_dc_{i}" for i in range(3)} | {f"f_rest_{i}" for i in range(45)},
    "features": {f"semantic_{i}" for i in range(3)},
    "anchors": {f"f_anchor_feat_{i}" for i in range(3)},
}
BASE_COLOURS = {**COLOURS, "harmonics": {f"f_dc_{i}" for i in range(3)}}
OWN = {
    "harmonics": {"opacity", *GEOMETRY},
    "features": {"opacity", *GEOMETRY},
    "anchors": {"scale_0", "scale_1", "scale_2"},
}


def attacked(name: str, model: Gaussians, seed: int = 0, **settings) -> Gaussians:
    return find_attack(name).apply(public(model), Measurements(), seed=seed, **settings).model


@pytest.mark.parametrize("kind", KINDS)
@unhurried
@given(bits=st.integers(1, 8), seed=st.integers(0, 99))
def test_quantized_values_are_off_by_at_most_half_a_step(kind: str, bits: int, seed: int) -> None:
    before = KINDS[kind](COUNT, seed)
    after = attacked("quantize", before, bits=bits)
    assert changed(before, after) <= COLOURS[kind] | OWN[kind]
    for name in COLOURS[kind] | OWN[kind]:
        old, new = before.table[name].astype(float), after.table[name].astype(float)
        step = np.ptp(old) / (2**bits - 1)
        assert np.abs(new - old).max() <= step / 2 + 1e-6 * np.abs(old).max()
        assert len(np.unique(new)) <= 2**bits
        assert (new.min(), new.max()) == (old.min(), old.max())


@unhurried
@given(bits=st.sampled_from([1, 4, 8, 16]), seed=st.integers(0, 99))
def test_quantizing_again_changes_nothing(bits: int, seed: int) -> None:
    once = attacked("quantize", blobs(COUNT, seed), bits=bits, attributes="position,colour")
    again = attacked("quantize", once, bits=bits, attributes="position,colour")
    np.testing.assert_allclose(again.means, once.means, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(again.sh_coeffs, once.sh_coeffs, rtol=1e-6, atol=1e-6)


def test_half_precision_is_that_of_ieee_and_does_not_overflow() -> None:
    before = blobs(COUNT).with_columns({"f_dc_0": np.linspace(-1e6, 1e6, COUNT)})
    after = attacked("quantize", before, bits=16)
    assert np.abs(after.table["f_dc_0"]).max() == 65504
    np.testing.assert_allclose(after.table["opacity"], before.table["opacity"], rtol=2**-11)
    np.testing.assert_array_equal(after.means, before.means)


def test_values_beyond_half_precision_are_counted_in_a_warning(capsys) -> None:
    attacked("quantize", blobs(COUNT), bits=16)
    assert capsys.readouterr().err == ""
    attacked("quantize", blobs(COUNT).with_columns({"f_dc_1": np.append(np.zeros(COUNT - 1), 1e30)}), bits=16)
    warning = capsys.readouterr().err
    assert "quantize" in warning
    assert f"f_dc_1: 1 of {COUNT} rows" in warning


@unhurried
@given(degree=st.integers(0, 2), stored=st.integers(1, 3))
def test_truncation_zeroes_the_harmonics_above_the_degree_and_no_others(degree: int, stored: int) -> None:
    before = blobs(COUNT, sh_degree=stored)
    if degree >= stored:
        with pytest.raises(InputError, match=f"not applicable: no harmonics above degree {degree}"):
            attacked("sh_truncation", before, degree=degree)
        return
    after, left = attacked("sh_truncation", before, degree=degree), (degree + 1) ** 2
    np.testing.assert_array_equal(after.sh_coeffs[:, :left], before.sh_coeffs[:, :left])
    assert not after.sh_coeffs[:, left:].any()
    assert {name.rpartition("_")[0] for name in changed(before, after)} == {"f_rest"}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("name", "setting"), [("feature_scaling", "factor"), ("gaussian_noise", "sigma")])
def test_base_colour_does_not_depend_on_direction(name: str, setting: str, kind: str) -> None:
    before = KINDS[kind](COUNT)
    after = attacked(name, before, attributes="base_colour", **{setting: 0.5})
    assert changed(before, after) == BASE_COLOURS[kind]


def test_opacity_noise_is_relative_and_has_the_given_deviation() -> None:
    before = blobs(20_000)
    after = attacked("opacity_noise", before, sigma=0.05)
    assert changed(before, after) == {"opacity"}
    middle = (before.opacities > 0.01) & (before.opacities < 0.7)  # nothing of these is clipped
    np.testing.assert_allclose((after.opacities / before.opacities)[middle].std(), 0.05, rtol=0.05)
    assert np.isfinite(after.table["opacity"]).all()


@pytest.mark.parametrize("attack", ["position_noise", "rigid_transform"])
@pytest.mark.parametrize(("offset", "warns"), [(0.0, False), (100.0, False), (4e5, True)])
def test_moves_that_float32_rounds_far_from_the_origin_are_warned_of(attack: str, offset: float, warns: bool, capsys):
    public = PublicModel(blobs(50).with_columns({"y": blobs(50).means[:, 1] + np.float32(offset)}))
    find_attack(attack).apply(public, Measurements())
    assert ("first move model and cameras" in capsys.readouterr().err) == warns


@pytest.mark.parametrize("kind", KINDS)
def test_position_noise_is_in_radii_and_moves_centres_only(kind: str) -> None:
    before = KINDS[kind](5000)
    after = attacked("position_noise", before, sigma=0.01)
    assert changed(before, after) == {"x", "y", "z"}
    np.testing.assert_allclose((after.means - before.means).std(axis=0), 0.01 * radius(before), rtol=0.05)


def test_the_radius_scales_with_the_model_and_not_with_a_floater() -> None:
    model, table = blobs(1000), blobs(1000).table.copy()
    table["y"][7] = -1e6
    assert radius(Gaussians(table)) == pytest.approx(radius(model), rel=0.01)
    doubled = model.with_columns({axis: 2 * model.table[axis] for axis in "xyz"})
    assert radius(doubled) == pytest.approx(2 * radius(model))


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("opacity_noise", {}),
        ("densify_clone", {}),
        ("feature_scaling", {"attributes": "opacity"}),
        ("gaussian_noise", {"attributes": "opacity"}),
        ("quantize", {"attributes": "opacity,rotation"}),
    ],
)
def test_attacks_on_missing_attributes_refuse_anchors(name: str, settings: dict) -> None:
    with pytest.raises(InputError, match="not applicable: rows do not store"):
        attacked(name, anchors(COUNT), **settings)
    attacked(name, features(COUNT), **settings)


@pytest.mark.parametrize(
    ("name", "settings", "message"),
    [
        ("quantize", {"bits": 9}, "bits: expected 1 to 8, or 16, found 9"),
        ("quantize", {"attributes": "colour,colour"}, "attributes: expected one or more of colour,base_colour,opacity"),
        ("sh_truncation", {"degree": -1}, "degree: expected a whole number from 0 to 3, found -1"),
        ("opacity_noise", {"sigma": -0.1}, "sigma: expected a number from 0"),
        ("position_noise", {"sigma": float("inf")}, "sigma: expected a number from 0 .* found inf"),
        ("crop", {"fraction": 2}, "fraction: expected a number from 0 to 1, found 2"),
        ("inject", {"fraction": float("nan")}, "fraction: expected a number from 0 to 1, found nan"),
        ("rigid_transform", {"axis": "0,0,0"}, "axis: expected an axis, found 0,0,0"),
        ("rigid_transform", {"axis": "up"}, "axis: expected three numbers separated by commas, found up"),
        (
            "rigid_transform",
            {"translation": "1,2"},
            "translation: expected three numbers .*, found 1,2",
        ),
        ("rigid_transform", {"translation": "0,1e39,0"}, "translation: expected at most 10000 radii"),
        ("rigid_transform", {"translation": "-1e38,0,0"}, "translation: expected at most 10000 radii"),
        ("rigid_transform", {"angle": float("inf")}, "angle: expected a number .* found inf"),
        ("compression", {"codec": "sog"}, "codec: expected one of compressed_ply, spz, found sog"),
    ],
)
def test_settings_out_of_range_are_refused(name: str, settings: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        attacked(name, blobs(COUNT), **settings)


@pytest.mark.parametrize(
    ("name", "settings", "column"),
    [
        ("position_noise", {"sigma": 1e6}, "x"),
        ("feature_scaling", {"factor": 1e6}, "f_dc_0"),
    ],
)
def test_numbers_that_overflow_are_refused_with_column_and_setting(name: str, settings: dict, column: str) -> None:
    large = blobs(400)
    large = large.with_columns({column: 1e35 * large.table[column] for column in ("x", "f_dc_0")})
    with pytest.raises(InputError) as caught:
        attacked(name, large, **settings)
    assert (caught.value.source, caught.value.field) == (f"attack {name}", column)
    assert all(f"{setting}={value}" in str(caught.value.hint) for setting, value in settings.items())
