"""Rigid motion: the model moves, views move along, and nothing else is to be seen of it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.attacks import Measurements, find_attack
from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.model.rotations import rotate_sh, rotation_matrices, sh_rotation
from tests.attack_cases import anchors, changed, features, public, unhurried
from tests.models import blobs, camera, tilted_camera
from tests.reference.blending import render
from tests.reference.spherical_harmonics import sh_basis, sh_colors

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


@unhurried
@given(axis=axes, angle=angles, translation=vectors)
def test_distances_and_shapes_stay(axis, angle, translation) -> None:
    before = blobs(COUNT)
    attacked = moved(before, angle, axis, translation)
    transform, after = attacked.transform, attacked.model
    np.testing.assert_allclose(distances(after.means), distances(before.means), rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(covariances(after), turn(transform, covariances(before)), atol=1e-5)
    np.testing.assert_allclose(after.means, before.means @ transform[:3, :3].T + transform[:3, 3], rtol=1e-5, atol=1e-5)
    assert changed(before, after) <= {
        *("x", "y", "z", "rot_0", "rot_1", "rot_2", "rot_3"),
        *before.columns_named("f_rest_"),
    }


@unhurried
@given(axis=axes, angle=angles, translation=vectors, degree=degrees)
def test_colours_are_the_same_from_moved_views(axis, angle, translation, degree) -> None:
    before = blobs(COUNT, sh_degree=degree)
    attacked = moved(before, angle, axis, translation)
    centre = tilted_camera().moved(attacked.transform).centre
    colours = sh_colors(attacked.model.sh_coeffs, attacked.model.means, centre)
    np.testing.assert_allclose(colours, sh_colors(before.sh_coeffs, before.means, tilted_camera().centre), atol=1e-4)


@pytest.mark.parametrize("view", [camera(), tilted_camera()], ids=["straight", "tilted"])
def test_images_are_the_same_from_moved_views_and_others_from_the_old_ones(view) -> None:
    before = blobs(COUNT)
    attacked = moved(before, 70.0, (1, 2, -1), (0.5, 0, -1))
    truth = render(before, view, "ewa").channels
    assert np.abs(render(attacked.model, view.moved(attacked.transform), "ewa").channels - truth).mean() < 1e-4
    assert np.abs(render(attacked.model, view, "ewa").channels - truth).mean() > 1e-2


@unhurried
@given(axis=axes, angle=st.floats(-180, 180))
def test_turning_back_restores_the_model(axis, angle) -> None:
    before = blobs(COUNT)
    after = moved(moved(before, angle, axis).model, -angle, axis).model
    np.testing.assert_allclose(after.means, before.means, atol=1e-4)
    np.testing.assert_allclose(after.sh_coeffs, before.sh_coeffs, atol=1e-5)
    np.testing.assert_allclose(after.quats, before.quats, atol=1e-5)


def test_features_have_no_direction_and_stay() -> None:
    assert changed(features(COUNT), moved(features(COUNT), 30.0).model) <= {
        "x",
        "y",
        "z",
        *(f"rot_{i}" for i in range(4)),
    }


def test_anchors_are_translated_but_not_rotated() -> None:
    attacked = moved(anchors(COUNT), 0.0, translation=(1, 0, 0))
    assert changed(anchors(COUNT), attacked.model) == {"x"}
    with pytest.raises(InputError, match="not applicable: rows do not store rotation"):
        moved(anchors(COUNT), 30.0)


def test_the_identity_transform_leaves_views_bit_identical() -> None:
    assert (tilted_camera().moved(np.eye(4)).numbers == tilted_camera().numbers).all()


def distances(means: np.ndarray) -> np.ndarray:
    return np.linalg.norm(means[:, None].astype(float) - means, axis=2)


def covariances(model: Gaussians) -> np.ndarray:
    axes = rotation_matrices(model.quats) * model.scales[:, None]
    return axes @ axes.transpose(0, 2, 1)


def turn(transform: np.ndarray, covs: np.ndarray) -> np.ndarray:
    return transform[:3, :3] @ covs @ transform[:3, :3].T
