"""Rigid motion: the model moves, views move along, and nothing else is to be seen of it."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.artifacts import motion_of, save_array, write_record
from gspure.attacks import Evidence, find_attack
from gspure.cameras import read_cameras, write_cameras
from gspure.cli import main
from gspure.cli.options import read_views
from gspure.errors import InputError
from gspure.model import Gaussians, read_model, write_model
from gspure.model.rotations import rotation_matrices
from gspure.model.sh_rotation import rotate_sh, rotation_matrix
from gspure.workflow.configuration import resolved, validated
from tests.attack_cases import anchors, changed, features, public, unhurried
from tests.documentation import ROOT
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
    return find_attack("rigid_transform").apply(public(model), Evidence(), angle=angle, **texts)


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
    first, second = (rotation_matrix(degree, radians * unit) for radians in (one, other))
    np.testing.assert_allclose(first @ first.T, np.eye(2 * degree + 1), atol=1e-12)
    np.testing.assert_allclose(second @ first, rotation_matrix(degree, (one + other) * unit), atol=1e-12)


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


def test_commands_pass_the_rigid_transform_on(tmp_path: Path) -> None:
    write_model(tmp_path / "model.ply", blobs(COUNT))
    write_cameras(tmp_path / "cameras.json", [tilted_camera()])
    files = ["--model", str(tmp_path / "model.ply"), "--out", str(tmp_path / "out.ply")]
    for name, transform in (("reorder", np.eye(4)), ("rigid_transform", moved(blobs(COUNT), 30.0).transform)):
        assert main(["attack", name, *files, "--transform", str(tmp_path / "transform.npy")]) == 0
        np.testing.assert_array_equal(np.load(tmp_path / "transform.npy"), transform)
    (view,) = read_views(Arguments(tmp_path))
    expected = tilted_camera().moved(moved(blobs(COUNT), 30.0).transform).viewmat
    np.testing.assert_allclose(view.viewmat, expected, atol=1e-12)


def test_views_of_a_model_that_another_attack_moved_are_refused(tmp_path: Path) -> None:
    write_model(tmp_path / "model.ply", blobs(COUNT))
    write_cameras(tmp_path / "cameras.json", [tilted_camera()])
    for angle, out in (("30", "out"), ("60", "further")):
        files = f"--model {tmp_path}/model.ply --out {tmp_path}/{out}.ply --transform {tmp_path}/transform.npy"
        assert main(["attack", "rigid_transform", "--set", f"angle={angle}", *files.split()]) == 0
    with pytest.raises(InputError, match=r"transform.npy: --transform: expected the motion of .*out\.ply"):
        read_views(Arguments(tmp_path))
    (tmp_path / "out.ply.json").unlink()
    assert len(read_views(Arguments(tmp_path))) == 1


@pytest.mark.parametrize(
    "motion",
    [
        np.zeros((4, 4)),
        2 * np.eye(4),
        np.full((4, 4), 1e200),
        np.array([[0, 0, 0, 0], [1e-312, -1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
        np.full((4, 4), np.nan),
        np.diag([1, 1, 1, np.inf]),
        np.diag([-1.0, 1, 1, 1]),
    ],
)
def test_a_record_with_a_motion_that_is_not_rigid_is_refused(tmp_path: Path, motion) -> None:
    write_model(tmp_path / "model.ply", blobs(COUNT))
    write_record(tmp_path / "model.ply", inputs={}, settings={}, motion=motion)
    with pytest.raises(InputError, match=r"model\.ply\.json: motion: expected a (rotation without|rigid transform)"):
        motion_of(tmp_path / "model.ply")


def test_the_transform_of_a_model_that_was_moved_twice_is_of_both_motions(tmp_path: Path) -> None:
    write_model(tmp_path / "model.ply", blobs(COUNT))
    write_cameras(tmp_path / "cameras.json", [tilted_camera()])
    for before, after, angle, shift in (("model", "once", "30", "0,0,0"), ("once", "out", "60", "1,0,0")):
        files = f"--model {tmp_path}/{before}.ply --out {tmp_path}/{after}.ply --transform {tmp_path}/transform.npy"
        settings = f"--set angle={angle} --set translation={shift}"
        assert main(["attack", "rigid_transform", *settings.split(), *files.split()]) == 0
    (view,) = read_views(Arguments(tmp_path))
    images = (
        render(read_model(tmp_path / f"{name}.ply"), seen, "ewa").channels
        for name, seen in (("model", tilted_camera()), ("out", view))
    )
    assert np.abs(np.subtract(*images)).mean() < 1e-4
    assert main(["attack", "random_pruning", "--model", f"{tmp_path}/out.ply", "--out", f"{tmp_path}/pruned.ply"]) == 0
    args = Arguments(tmp_path)
    args.model = tmp_path / "pruned.ply"
    assert len(read_views(args)) == 1
    save_array(args.transform, moved(blobs(1), 60.0).transform)  # the last motion alone
    with pytest.raises(InputError, match="--transform: expected the motion"):
        read_views(args)


def test_views_that_do_not_move_with_the_model_are_warned_of(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    write_model(tmp_path / "model.ply", blobs(COUNT))
    write_cameras(tmp_path / "cameras.json", [tilted_camera()])
    transform = f"--transform {tmp_path}/transform.npy"
    for attack, model, out in (
        (f"rigid_transform {transform}", "model", "moved"),
        ("random_pruning", "moved", "moved_and_pruned"),
        ("rigid_transform --set angle=0", "model", "unmoved"),
        ("reorder", "unmoved", "reordered"),
    ):
        assert main(["attack", *f"{attack} --model {tmp_path}/{model}.ply --out {tmp_path}/{out}.ply".split()]) == 0

    def warned(model: str, *, transformed: bool, original: bool = False) -> bool:
        args = Arguments(tmp_path)
        args.original = tmp_path / "model.ply" if original else None
        args.model, args.transform = tmp_path / f"{model}.ply", args.transform if transformed else None
        capsys.readouterr()
        read_views(args)
        return "an attack moved" in capsys.readouterr().err

    assert warned("moved", transformed=False)
    assert warned("moved_and_pruned", transformed=False)
    assert not warned("moved", transformed=True)
    assert not warned("moved", transformed=False, original=True)
    assert not warned("moved_and_pruned", transformed=True)
    assert not warned("model", transformed=True)  # it has no record
    for model in ("unmoved", "reordered"):
        assert not warned(model, transformed=False)
        with pytest.raises(InputError, match="--transform: expected the motion"):
            warned(model, transformed=True)


def test_the_motion_of_a_model_without_a_record_stays_unknown(tmp_path: Path) -> None:
    write_model(tmp_path / "model.ply", blobs(COUNT))
    write_cameras(tmp_path / "cameras.json", [tilted_camera()])
    files = f"--model {tmp_path}/model.ply --out {tmp_path}/out.ply"
    assert main(["attack", "random_pruning", *files.split()]) == 0
    assert motion_of(tmp_path / "out.ply") is None
    save_array(tmp_path / "transform.npy", moved(blobs(1), 60.0).transform)
    assert len(read_views(Arguments(tmp_path))) == 1


def test_generated_views_follow_the_model_that_they_look_at(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    write_model(tmp_path / "model.ply", blobs(COUNT))
    transform = f"--transform {tmp_path}/transform.npy"
    assert (
        main(f"attack rigid_transform {transform} --model {tmp_path}/model.ply --out {tmp_path}/out.ply".split()) == 0
    )
    model, orbit = f"{tmp_path}/out.ply", ["--count", "3", "--width", "32", "--height", "24"]
    assert main(["cameras", "orbit", "--model", model, *orbit, "--out", f"{tmp_path}/cameras.json"]) == 0
    assert main(["cameras", f"{tmp_path}/cameras.json", "--out", f"{tmp_path}/copied.json"]) == 0
    assert main(["purify", model, "--cameras", "orbit", "--out", f"{tmp_path}/purified"]) == 0
    assert main(["render", model, "--cameras", "orbit", "--out", f"{tmp_path}/renders"]) == 0
    for name in ("cameras.json", "copied.json", "purified/cameras.json", "renders"):
        args = Arguments(tmp_path)
        args.cameras = tmp_path / name
        capsys.readouterr()
        moved_again = read_views(args)  # --transform is the motion that they follow already
        args.transform = None
        for view, same in zip(read_views(args), moved_again, strict=True):
            np.testing.assert_allclose(view.numbers, same.numbers, atol=1e-9)
        assert "an attack moved" not in capsys.readouterr().err


def test_a_moved_model_that_is_attacked_again_is_rendered_from_views_around_it(tmp_path: Path) -> None:
    write_model(tmp_path / "model.ply", blobs(COUNT))
    for before, after in (("model", "once"), ("once", "out")):
        files = f"--model {tmp_path}/{before}.ply --out {tmp_path}/{after}.ply --transform {tmp_path}/transform.npy"
        assert main(["attack", "rigid_transform", "--set", "translation=1,2,3", *files.split()]) == 0
    orbit = f"cameras orbit --model {tmp_path}/once.ply --count 3 --out {tmp_path}/cameras.json"
    assert main(orbit.split()) == 0
    transform = moved(read_model(tmp_path / "once.ply"), 30.0, translation=(1, 2, 3)).transform
    for view, before in zip(read_views(Arguments(tmp_path)), read_cameras(tmp_path / "cameras.json"), strict=True):
        np.testing.assert_allclose(view.viewmat, before.moved(transform).viewmat, atol=1e-6)


def test_the_workflow_refuses_views_that_a_model_does_not_move_with(tmp_path: Path) -> None:
    write_model(tmp_path / "model.ply", blobs(COUNT))
    write_cameras(tmp_path / "cameras.json", [tilted_camera()])
    assert main(f"attack rigid_transform --model {tmp_path}/model.ply --out {tmp_path}/out.ply".split()) == 0
    schema = ROOT / "schemas" / "config.schema.yaml"
    asset = {"model": str(tmp_path / "out.ply"), "cameras": str(tmp_path / "cameras.json")}
    with pytest.raises(InputError, match=r"assets.moved.cameras: expected views that moved with the model"):
        resolved(validated({"assets": {"moved": asset}}, schema, "c.yaml"), "c.yaml")
    assert main(f"cameras orbit --model {tmp_path}/out.ply --out {tmp_path}/around.json".split()) == 0
    around = {**asset, "cameras": str(tmp_path / "around.json")}
    with pytest.raises(InputError, match=r"assets.moved.model: expected an unattacked model, found .* of rigid_"):
        resolved(validated({"assets": {"moved": around}}, schema, "c.yaml"), "c.yaml")
    (tmp_path / "out.ply.json").unlink()
    resolved(validated({"assets": {"moved": asset}}, schema, "c.yaml"), "c.yaml")


class Arguments:
    split, up, original = "all", None, None

    def __init__(self, folder: Path) -> None:
        self.cameras, self.transform, self.model = (folder / f for f in ("cameras.json", "transform.npy", "out.ply"))


def distances(means: np.ndarray) -> np.ndarray:
    return np.linalg.norm(means[:, None].astype(float) - means, axis=2)


def covariances(model: Gaussians) -> np.ndarray:
    axes = rotation_matrices(model.quats) * model.scales[:, None]
    return axes @ axes.transpose(0, 2, 1)


def turn(transform: np.ndarray, covs: np.ndarray) -> np.ndarray:
    return transform[:3, :3] @ covs @ transform[:3, :3].T
