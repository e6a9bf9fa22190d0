"""Rigid motion: the model moves, views move along, and nothing else is to be seen of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.attacks import Measurements, find_attack
from gspure.model import Gaussians
from gspure.model.rotations import rotate_sh, sh_rotation
from tests.attack_cases import public, unhurried
from tests.models import blobs, camera, tilted_camera
from tests.reference.blending import render
from tests.reference.spherical_harmonics import sh_basis

COUNT = 20
angles = st.floats(-400, 400)
vectors = st.tuples(*[st.floats(-3, 3)] * 3)
axes = vectors.filter(lambda axis: np.linalg.norm(axis) > 0.1)
degrees = st.integers(0, 3)


def moved(model: Gaussians, angle: float, axis=(0, 1, 0), translation=(0, 0, 0)):
    texts = {"axis": ",".join(map(str, axis)), "translation": ",".join(map(str, translation))}
    return find_attack("rigid_transform").apply(public(model), Measurements(), angle=angle, **texts)


@unhurried
@given(degree=st.integers(1, 3), axis=axes, angle=angles, seed=st.integers(0, 99))
def test_turned_harmonics_are_those_seen_from_turned_directions(degree, axis, angle, seed) -> None:
    unit, radians = np.array(axis) / np.linalg.norm(axis), np.deg2rad(angle)
    rotation = moved(blobs(1), angle, axis).transform[:3, :3]
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(10, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    coeffs = rng.normal(size=(1, (degree + 1) ** 2, 3))
    before = sh_basis(directions)[:, : coeffs.shape[1]] @ coeffs[0]
    after = sh_basis(directions @ rotation.T)[:, : coeffs.shape[1]] @ rotate_sh(coeffs, radians * unit)[0]
    np.testing.assert_allclose(after, before, atol=1e-10)


@unhurried
@given(degree=degrees, axis=axes, one=angles, other=angles)
def test_matrices_of_harmonics_are_orthogonal_and_turns_add_up(degree, axis, one, other) -> None:
    unit, (one, other) = np.array(axis) / np.linalg.norm(axis), np.deg2rad([one, other])
    first, second = (sh_rotation(degree, radians * unit) for radians in (one, other))
    np.testing.assert_allclose(first @ first.T, np.eye(2 * degree + 1), atol=1e-12)
    np.testing.assert_allclose(second @ first, sh_rotation(degree, (one + other) * unit), atol=1e-12)


@pytest.mark.parametrize("view", [camera(), tilted_camera()], ids=["straight", "tilted"])
def test_images_are_the_same_from_moved_views_and_others_from_the_old_ones(view) -> None:
    before = blobs(COUNT)
    attacked = moved(before, 70.0, (1, 2, -1), (0.5, 0, -1))
    truth = render(before, view, "ewa").channels
    assert np.abs(render(attacked.model, view.moved(attacked.transform), "ewa").channels - truth).mean() < 1e-4
    assert np.abs(render(attacked.model, view, "ewa").channels - truth).mean() > 1e-2
