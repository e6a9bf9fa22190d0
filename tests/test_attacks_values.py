"""Attacks that change stored values: which columns, by how much, and where there is nothing to change."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.attacks import Measurements, find_attack
from gspure.attacks.geometry import radius
from gspure.errors import InputError
from gspure.model import Gaussians
from tests.attack_cases import KINDS, anchors, changed, features, public, unhurried
from tests.models import blobs

COUNT = 30
GEOMETRY = {"scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}
COLOURS = {
    "harmonics": {f"f_dc_{i}" for i in range(3)} | {f"f_rest_{i}" for i in range(45)},
    "features": {f"semantic_{i}" for i in range(3)},
    "anchors": {f"f_anchor_feat_{i}" for i in range(3)},
}
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


def test_half_precision_is_that_of_ieee_and_does_not_overflow() -> None:
    before = blobs(COUNT).with_columns({"f_dc_0": np.linspace(-1e6, 1e6, COUNT)})
    after = attacked("quantize", before, bits=16)
    assert np.abs(after.table["f_dc_0"]).max() == 65504
    np.testing.assert_allclose(after.table["opacity"], before.table["opacity"], rtol=2**-11)
    np.testing.assert_array_equal(after.means, before.means)


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


def test_opacity_noise_is_relative_and_has_the_given_deviation() -> None:
    before = blobs(20_000)
    after = attacked("opacity_noise", before, sigma=0.05)
    assert changed(before, after) == {"opacity"}
    middle = (before.opacities > 0.01) & (before.opacities < 0.7)  # nothing of these is clipped
    np.testing.assert_allclose((after.opacities / before.opacities)[middle].std(), 0.05, rtol=0.05)
    assert np.isfinite(after.table["opacity"]).all()


@pytest.mark.parametrize("kind", KINDS)
def test_position_noise_is_in_radii_and_moves_centres_only(kind: str) -> None:
    before = KINDS[kind](5000)
    after = attacked("position_noise", before, sigma=0.01)
    assert changed(before, after) == {"x", "y", "z"}
    np.testing.assert_allclose((after.means - before.means).std(axis=0), 0.01 * radius(before), rtol=0.05)


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
