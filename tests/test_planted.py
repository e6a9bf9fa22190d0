"""The planted pair: what is public, what the key holds, and what it reveals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gspure.artifacts import load_array
from gspure.cameras import read_cameras
from gspure.cli import main
from gspure.errors import InputError
from gspure.images import read_image
from gspure.model import read_model, write_model
from gspure.model.gaussians import Gaussians
from gspure.renderer import Renderer
from gspure.scenes import lighting, plant, read_key, reveal, seen_points, trace, write_key
from gspure.scenes.planted import HIDDEN
from gspure.scenes.scene import Lamp, Scene
from gspure.scenes.solids import Box, Sphere
from gspure.scenes.sparse_points import PER_VIEW
from gspure.scenes.surfels import SPREAD, tile
from gspure.scenes.textures import checker, plain
from gspure.training.dataset import read_dataset

SMALL = {"gaussians": 1200, "views": 3, "width": 32, "height": 24}


@pytest.fixture(autouse=True, scope="module")
def coarse():
    """Light maps that are quick to bake."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lighting, "NODE_SPACING", 0.5)
        patch.setattr(lighting, "DIRECTIONS", 4)
        patch.setattr(lighting, "LAMP_SAMPLES", 2)
        yield


@pytest.fixture(scope="module")
def planted():
    return plant(0, **SMALL)


@pytest.fixture(scope="module")
def two_solids():
    box = Box((0.0, 0.0, 0.5), (2.0, 1.0, 1.0), (checker("#000000", "#ffffff", 0.3),), yaw=0.4)
    return lighting.bake(
        Scene((box, Sphere((3.0, 0.0, 1.0), 0.5, (plain("#ff8000"),))), Lamp((0, 0, 5), 1, (9, 9, 9)), (1, 1, 1))
    )


def psnr(a, b):
    return -10.0 * np.log10(np.mean((np.clip(a, 0.0, 1.0) - b) ** 2))


def test_planting_again_gives_the_same_bits_and_another_seed_others(planted):
    again, other = plant(0, **SMALL), plant(1, **SMALL)
    assert again.public.table.tobytes() == planted.public.table.tobytes()
    for name in ("rows", "positions", "opacity", "f_dc"):
        assert getattr(again.key, name).tobytes() == getattr(planted.key, name).tobytes()
    assert other.public.table.tobytes() != planted.public.table.tobytes()


def test_the_public_model_is_a_vanilla_one(planted, tmp_path):
    write_model(tmp_path / "public.ply", planted.public)
    back = read_model(tmp_path / "public.ply")
    assert back.table.tobytes() == planted.public.table.tobytes()
    assert back.sh_degree == 3
    rest = [f"f_rest_{i}" for i in range(45)]
    assert list(back.table.dtype.names) == (
        ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", *rest, "opacity"]
        + [f"scale_{i}" for i in range(3)]
        + [f"rot_{i}" for i in range(4)]
    )
    assert all(np.isfinite(back.table[name]).all() for name in back.table.dtype.names)


def test_the_truth_is_the_keys_rows_and_both_kinds_are_shuffled(planted):
    assert np.flatnonzero(planted.carries_message).tolist() == planted.key.rows.tolist()
    assert planted.public.means[planted.key.rows].tobytes() == planted.key.positions.tobytes()
    first, second = np.array_split(planted.carries_message, 2)
    assert abs(first.mean() - second.mean()) < 0.1


def test_carriers_are_next_to_invisible_unless_they_serve_the_scene_too(planted):
    carriers = planted.public.opacities[planted.carries_message]
    hidden = carriers <= HIDDEN[1] * 1.001
    assert carriers.min() >= HIDDEN[0] * 0.999
    assert hidden.mean() > 0.8
    assert (carriers > 1 / 255).mean() > 0.5  # they touch pixels


def test_carriers_look_like_the_scene_in_the_public_model(planted):
    dc = planted.public.sh_coeffs[:, 0]
    scene = {row.tobytes() for row in dc[~planted.carries_message]}
    hidden = dc[planted.carries_message & (planted.public.opacities <= HIDDEN[1])]
    assert np.mean([row.tobytes() in scene for row in hidden]) > 0.8  # the rest had their colour from a shared one


def test_the_scene_has_its_own_gaussians_of_little_weight(planted):
    scene = planted.public.opacities[~planted.carries_message]
    assert 0.02 < np.mean(scene < 0.4) < 0.2
    assert (scene < HIDDEN[1]).any()


def test_coincident_surfaces_share_gaussians():
    shared = {
        name: np.count_nonzero(p.carries_message & (p.public.opacities > 0.5))
        for name in ("coincident", "behind")
        for p in [plant(0, placement=name, **SMALL)]
    }
    assert shared["coincident"] > 2 * shared["behind"]
    assert shared["behind"] > 0  # the block stands in both


def test_revealing_gives_all_carriers_with_private_opacity_and_colour(planted):
    message = reveal(planted.public, planted.key)
    assert len(message) == len(planted.key.rows)
    assert message.opacities.min() > 0.89
    assert message.columns("f_dc_0", "f_dc_1", "f_dc_2").tobytes() == planted.key.f_dc.tobytes()
    assert not message.sh_coeffs[:, 1:].any()
    geometry = ("x", "y", "z", *(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4)))
    assert (
        message.columns(*geometry).tobytes()
        == planted.public.subset(planted.carries_message).columns(*geometry).tobytes()
    )


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 1.0))
def test_revealing_finds_exactly_the_survivors_in_any_order(planted, seed, share):
    rng = np.random.default_rng(seed)
    rows = rng.permutation(len(planted.public))[: round(share * len(planted.public))]
    message = reveal(Gaussians(planted.public.table[rows]), planted.key)
    survivors = rows[planted.carries_message[rows]]
    place = np.searchsorted(planted.key.rows, survivors)
    assert message.means.tobytes() == planted.key.positions[place].tobytes()
    assert message.columns("opacity")[:, 0].tobytes() == planted.key.opacity[place].tobytes()


def test_a_moved_carrier_is_lost(planted):
    moved = planted.public.with_columns({"x": np.nextafter(planted.public.means[:, 0], np.float32(np.inf))})
    assert len(reveal(moved, planted.key)) == 0


def test_the_key_of_another_pair_reveals_nothing(planted):
    assert len(reveal(planted.public, plant(1, **SMALL).key)) == 0


def test_a_key_file_gives_the_key_back_and_is_the_same_bytes_again(planted, tmp_path):
    for name in ("a.npz", "b.npz"):
        write_key(tmp_path / name, planted.key)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    back = read_key(tmp_path / "a.npz")
    for name in ("rows", "positions", "opacity", "f_dc"):
        assert getattr(back, name).tobytes() == getattr(planted.key, name).tobytes()


GOOD = {
    "rows": np.arange(2),
    "positions": np.zeros((2, 3), np.float32),
    "opacity": np.zeros(2, np.float32),
    "f_dc": np.zeros((2, 3), np.float32),
}


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("rows", None),
        ("f_dc", None),
        ("opacity", np.zeros(2)),
        ("positions", np.zeros((2, 2), np.float32)),
        ("positions", np.zeros((3, 3), np.float32)),
        ("f_dc", np.full((2, 3), np.nan, np.float32)),
    ],
)
def test_a_key_with_a_wrong_array_is_refused_by_name(tmp_path, field, value):
    arrays = {name: array for name, array in (GOOD | {field: value}).items() if array is not None}
    np.savez(tmp_path / "key.npz", **arrays)
    with pytest.raises(InputError) as error:
        read_key(tmp_path / "key.npz")
    assert field in str(error.value) or field == "rows"
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 no archive", b"\x93NUMPY"])
def test_a_file_that_is_no_key_is_refused(tmp_path, content):
    (tmp_path / "key.npz").write_bytes(content)
    with pytest.raises(InputError, match=r"key\.npz"):
        read_key(tmp_path / "key.npz")


def test_a_key_that_holds_objects_or_is_one_array_is_refused(tmp_path):
    np.savez(tmp_path / "key.npz", **(GOOD | {"rows": np.array([object(), object()])}))
    with pytest.raises(InputError, match="pickle"):
        read_key(tmp_path / "key.npz")
    with (tmp_path / "array.npz").open("wb") as stream:
        np.save(stream, np.zeros(3))
    with pytest.raises(InputError, match="not a zip file"):
        read_key(tmp_path / "array.npz")


@settings(max_examples=15, deadline=None)
@given(count=st.integers(1, 150), seed=st.integers(0, 99))
def test_tiling_gives_any_number_of_flat_right_handed_surfels(two_solids, count, seed):
    surfels = tile(two_solids, count, np.random.default_rng(seed))
    assert len(surfels) == count
    np.testing.assert_allclose(
        surfels.frames @ surfels.frames.transpose(0, 2, 1), np.tile(np.eye(3), (count, 1, 1)), atol=1e-6
    )
    np.testing.assert_allclose(np.linalg.det(surfels.frames), 1.0, atol=1e-6)
    assert (surfels.scales > 0.0).all()
    assert ((surfels.colours >= 0.0) & (surfels.colours <= 1.0)).all()


def test_tiles_cover_the_area_once_and_are_smaller_where_colours_change(two_solids):
    surfels = tile(two_solids, 600, np.random.default_rng(0))
    areas = surfels.scales[:, 0] * surfels.scales[:, 1] / SPREAD**2
    on_box = surfels.means[:, 0] < 2.0
    assert areas[on_box].sum() == pytest.approx(2 * (2.0 + 1.0) + 2.0)
    assert areas[~on_box].sum() == pytest.approx(np.pi, rel=0.05)
    assert np.median(areas[on_box]) < np.median(areas[~on_box])


@pytest.mark.parametrize("field", ["scene", "message", "placement"])
def test_an_unknown_name_is_refused_with_those_known(field):
    with pytest.raises(InputError, match=r"one of .*'nowhere'"):
        plant(0, **{field: "nowhere"})


def test_renderings_resemble_the_photographs(device):
    planted = plant(0, gaussians=16000, views=3, width=160, height=120)
    view = planted.cameras[1]
    message = reveal(planted.public, planted.key)
    assert psnr(Renderer(planted.public, device).image(view), trace(planted.scene, view)[0]) > 22.0
    assert psnr(Renderer(message, device).image(view), trace(planted.message, view)[0]) > 21.0


def test_points_lie_where_a_photograph_shows_them_in_its_colours(planted):
    view = planted.cameras[0]
    image, depth = trace(planted.scene, view)
    xyz, rgb = seen_points(view, image, depth, np.random.default_rng(0))
    x, y, z = view.K @ (view.viewmat[:3, :3] @ xyz.T + view.viewmat[:3, 3:])
    rows, columns = np.floor(y / z).astype(int), np.floor(x / z).astype(int)
    assert len({*zip(rows.tolist(), columns.tolist(), strict=True)}) == PER_VIEW
    np.testing.assert_allclose(z, depth[rows, columns], rtol=1e-6)
    np.testing.assert_allclose(rgb / 255, image[rows, columns], atol=0.5 / 255 + 1e-6)


def test_the_commands_write_a_whole_planted_folder_and_reveal_its_message(planted, tmp_path):
    options = [f"--{name}={value}" for name, value in SMALL.items()]
    assert main(["plant", "--out", str(tmp_path), *options]) == 0
    model = tmp_path / "public" / "point_cloud.ply"
    assert read_model(model).table.tobytes() == planted.public.table.tobytes()
    carriers = load_array(tmp_path / "key" / "carriers.npy", dtype=np.bool_, shape=(len(planted.public),))
    assert carriers.tobytes() == planted.carries_message.tobytes()
    for camera, wanted in zip(read_cameras(tmp_path / "cameras.json"), planted.cameras, strict=True):
        np.testing.assert_allclose(camera.numbers, wanted.numbers, atol=1e-12)
        photo = read_image(tmp_path / "truth" / "message" / f"{camera.name}.png")
        np.testing.assert_allclose(photo, trace(planted.message, wanted)[0], atol=0.5 / 255 + 1e-6)
        assert (tmp_path / "truth" / "scene" / f"{camera.name}.png").exists()
    data = read_dataset(tmp_path, "native")
    assert {view.image.parent for view in data.train} == {tmp_path / "truth" / "scene"}
    assert len(data.xyz) == 3 * PER_VIEW
    message = tmp_path / "message.ply"
    assert main(["message", str(model), "--key", str(tmp_path / "key" / "planted_key.npz"), "--out", str(message)]) == 0
    assert read_model(message).table.tobytes() == reveal(planted.public, planted.key).table.tobytes()


@pytest.mark.parametrize("options", [["--views", "0"], ["--gaussians", "9"], ["--seed", "-1"], ["--scene", "nowhere"]])
def test_planting_with_a_bad_option_is_refused_in_one_line(tmp_path, capsys, options):
    assert main(["plant", "--out", str(tmp_path / "planted"), *options]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert not (tmp_path / "planted").exists()


def test_a_model_without_colour_has_no_message(planted, tmp_path, capsys):
    bare = planted.public.table[
        ["x", "y", "z", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    ]
    write_model(tmp_path / "bare.ply", Gaussians(np.array(bare.tolist(), [(n, "<f4") for n in bare.dtype.names])))
    write_key(tmp_path / "key.npz", planted.key)
    argv = ["message", str(tmp_path / "bare.ply"), "--key", str(tmp_path / "key.npz"), "--out", str(tmp_path / "m.ply")]
    assert main(argv) == 2
    assert "f_dc_0" in capsys.readouterr().err
