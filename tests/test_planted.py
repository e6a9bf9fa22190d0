"""Planted messages: what is public, what the key holds, and what it reveals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gspure.cli import main
from gspure.errors import InputError
from gspure.evaluation.recall import MESSAGE_ROWS
from gspure.images import read_image
from gspure.model import read_model, write_model
from gspure.model.gaussians import Gaussians
from gspure.public_model import PublicModel
from gspure.scenes import lighting
from gspure.scenes.photography import PER_VIEW, path_cameras, visible_points
from gspure.scenes.ray_tracer import trace
from gspure.scenes.scene import Lamp, Scene
from gspure.scenes.solids import Box, Sphere
from gspure.scenes.staging import Staging
from gspure.scenes.surfels import SPREAD, tile
from gspure.scenes.textures import checker, plain
from gspure.schemes.planted.embedding import HIDDEN
from gspure.schemes.planted.key import PlantedKey
from tests.planted_cases import STAGING, planted_model

SMALL = {"gaussians": 1200}
VIEW = path_cameras(3, 32, 24)[0]


@pytest.fixture(autouse=True, scope="module")
def coarse(pair_folder):
    """Light maps that are quick to bake; those of the shared pair are fine."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lighting, "NODE_SPACING", 0.5)
        patch.setattr(lighting, "DIRECTIONS", 4)
        patch.setattr(lighting, "LAMP_SAMPLES", 2)
        yield


@pytest.fixture(scope="module")
def planted():
    return planted_model(**SMALL)


@pytest.fixture(scope="module")
def public(planted):
    return planted[0].model


@pytest.fixture(scope="module")
def key(planted):
    return planted[1]


def revealed(model, key):
    return key.gaussians(PublicModel(model), VIEW, "message")


@pytest.fixture(scope="module")
def two_solids():
    box = Box((0.0, 0.0, 0.5), (2.0, 1.0, 1.0), (checker("#000000", "#ffffff", 0.3),), yaw=0.4)
    return lighting.bake(
        Scene((box, Sphere((3.0, 0.0, 1.0), 0.5, (plain("#ff8000"),))), Lamp((0, 0, 5), 1, (9, 9, 9)), (1, 1, 1))
    )


def psnr(a, b):
    return -10.0 * np.log10(np.mean((np.clip(a, 0.0, 1.0) - b) ** 2))


def test_the_public_model_is_a_vanilla_one(public, tmp_path):
    write_model(tmp_path / "public.ply", public)
    back = read_model(tmp_path / "public.ply")
    assert back.table.tobytes() == public.table.tobytes()
    assert back.sh_degree == 3
    rest = [f"f_rest_{i}" for i in range(45)]
    assert list(back.table.dtype.names) == (
        ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", *rest, "opacity"]
        + [f"scale_{i}" for i in range(3)]
        + [f"rot_{i}" for i in range(4)]
    )
    assert all(np.isfinite(back.table[name]).all() for name in back.table.dtype.names)


def test_rows_of_the_message_and_others_are_shuffled(public, key):
    assert len(key.message_rows) == len(public)
    first, second = np.array_split(key.message_rows, 2)
    assert abs(first.mean() - second.mean()) < 0.1


def test_rows_of_the_message_are_nearly_transparent_unless_the_scene_uses_them(public, key):
    message_rows = public.opacities[key.message_rows]
    hidden = message_rows <= HIDDEN[1] * 1.001
    assert message_rows.min() >= HIDDEN[0] * 0.999
    assert hidden.mean() > 0.8
    assert (message_rows > 1 / 255).mean() > 0.5  # they touch pixels


def test_rows_of_the_message_look_like_the_scene_in_the_public_model(public, key):
    dc = public.sh_coeffs[:, 0]
    scene = {row.tobytes() for row in dc[~key.message_rows]}
    hidden = dc[key.message_rows & (public.opacities <= HIDDEN[1])]
    assert np.mean([row.tobytes() in scene for row in hidden]) > 0.8  # the rest had their colour from a shared one


def test_the_scene_has_its_own_gaussians_of_little_weight(public, key):
    scene = public.opacities[~key.message_rows]
    assert 0.02 < np.mean(scene < 0.4) < 0.2
    assert (scene < HIDDEN[1]).any()


def test_coincident_surfaces_share_gaussians():
    shared = {}
    for placement in ("coincident", "behind"):
        public, key = planted_model(staging=Staging("room", "vault", placement), **SMALL)
        shared[placement] = np.count_nonzero(key.message_rows & (public.model.opacities > 0.5))
    assert shared["coincident"] > 2 * shared["behind"]
    assert shared["behind"] > 0  # the block stands in both


def test_the_message_is_all_of_its_rows_with_private_opacity_and_colour(public, key):
    message, rows = revealed(public, key)
    assert rows.tolist() == np.flatnonzero(key.message_rows).tolist()
    assert message.opacities.min() > 0.89
    assert message.columns("f_dc_0", "f_dc_1", "f_dc_2").tobytes() == key.f_dc.tobytes()
    assert not message.sh_coeffs[:, 1:].any()
    geometry = ("x", "y", "z", *(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4)))
    assert message.columns(*geometry).tobytes() == public[key.message_rows].columns(*geometry).tobytes()


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 1.0))
def test_the_message_is_exactly_the_surviving_rows_in_any_order(public, key, seed, share):
    rng = np.random.default_rng(seed)
    kept = rng.permutation(len(public))[: round(share * len(public))]
    message, rows = revealed(Gaussians(public.table[kept]), key)
    survivors = kept[key.message_rows[kept]]
    assert kept[rows].tolist() == survivors.tolist()
    assert message.means.tobytes() == public.means[survivors].tobytes()
    place = np.searchsorted(np.flatnonzero(key.message_rows), survivors)
    assert message.columns("opacity")[:, 0].tobytes() == key.opacity[place].tobytes()


def test_a_moved_carrier_is_lost(public, key):
    moved = public.with_columns({"x": np.nextafter(public.means[:, 0], np.float32(np.inf))})
    assert len(revealed(moved, key)[0]) == 0


def test_the_key_of_another_seed_does_not_extract_the_message(public):
    assert len(revealed(public, planted_model(1, **SMALL)[1])[0]) == 0


def test_a_wrong_key_takes_as_many_rows_as_the_right_one_and_mostly_those_of_the_scene(public, key):
    rows = revealed(public, key.wrong(np.random.default_rng(0)))[1]
    assert len(rows) == key.message_rows.sum()
    assert key.message_rows[rows].mean() == pytest.approx(key.message_rows.mean(), abs=0.1)


def test_photographs_are_refused():
    with pytest.raises(InputError, match="scheme planted: pair: expected a ray-traced pair"):
        planted_model(staging=None)


def test_the_scheme_works_on_a_pair_by_its_commands(pair_folder, tmp_path):
    settings = ["--set", "gaussians=600"]
    assert main(["embed", "planted", str(pair_folder), "--out", str(tmp_path), *settings]) == 0
    public = tmp_path / "public" / "point_cloud.ply"
    cameras = ["--cameras", str(pair_folder / "cameras.json"), "--split", "test"]
    views = ["--scheme", "planted", "--key", str(tmp_path / "key"), *cameras]
    assert main(["extract", str(public), *views, "--out", str(tmp_path / "message")]) == 0
    shown, hidden = (
        np.mean([psnr(read_image(view), read_image(pair_folder / name / view.name)) for view in views])
        for views in [sorted((tmp_path / "message").glob("*.png"))]
        for name in ("scene", "message")
    )
    assert hidden > shown + 5.0


def test_an_interrupted_embedding_leaves_no_model_beside_the_key_of_another(pair_folder, tmp_path, monkeypatch):
    command = ["embed", "planted", str(pair_folder), "--set", "gaussians=600"]
    assert main([*command, "--out", str(tmp_path / "marked")]) == 0
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(PlantedKey, "write", interrupt)
    for out in ("marked", "other"):
        assert main([*command, "--seed", "1", "--out", str(tmp_path / out)]) == 130
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("setting", ["gaussians=9", "message_weight=0.5"])
def test_a_setting_out_of_range_is_refused_in_one_line(pair_folder, tmp_path, capsys, setting):
    assert main(["embed", "planted", str(pair_folder), "--out", str(tmp_path / "marked"), "--set", setting]) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith("gspure embed: scheme planted: ")
    assert not (tmp_path / "marked").exists()


@pytest.fixture
def written(key, tmp_path):
    key.write(tmp_path)
    return tmp_path


def test_a_written_key_reads_back_and_is_the_same_bytes_again(key, written):
    before = (written / "planted.npz").read_bytes()
    back = PlantedKey.read(written)
    back.write(written)
    assert (written / "planted.npz").read_bytes() == before
    for name in ("message_rows", "positions", "opacity", "f_dc"):
        assert getattr(back, name).tobytes() == getattr(key, name).tobytes()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("f_dc", None),
        ("opacity", np.zeros(2)),
        ("opacity", np.zeros(2, np.float32)),
        ("positions", np.zeros((2, 2), np.float32)),
        ("f_dc", np.zeros((3, 3), np.float32)),
        ("f_dc", np.full((2, 3), np.nan, np.float32)),
    ],
)
def test_a_key_with_a_wrong_array_is_refused_by_name(key, written, field, value):
    arrays = {name: getattr(key, name) for name in ("positions", "opacity", "f_dc")} | {field: value}
    np.savez(written / "planted.npz", **{name: array for name, array in arrays.items() if array is not None})
    with pytest.raises(InputError, match=field):
        PlantedKey.read(written)


@pytest.mark.parametrize("file", ["planted.npz", MESSAGE_ROWS])
@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 no archive", b"\x93NUMPY"])
def test_a_file_that_is_not_a_key_is_refused(written, file, content):
    (written / file).write_bytes(content)
    with pytest.raises(InputError, match=file):
        PlantedKey.read(written)


def test_a_model_without_colour_has_no_message(public, key):
    names = ["x", "y", "z", "opacity", *(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4))]
    bare = Gaussians(np.array(public.table[names].tolist(), [(name, "<f4") for name in names]))
    with pytest.raises(InputError, match="f_dc_0"):
        revealed(bare, key)


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


def test_renderings_resemble_the_photographs(device):
    public, key = planted_model(gaussians=16000)
    view = path_cameras(3, 160, 120)[1]
    message = key.message(public, "message", device)(view)
    assert psnr(public.scene(device)(view), trace(STAGING.lit_scene(), view)[0]) > 22.0
    assert psnr(message, trace(STAGING.lit_message(), view)[0]) > 21.0


def test_points_lie_where_a_photograph_shows_them_in_its_colours():
    view = VIEW
    image, depth = trace(STAGING.lit_scene(), view)
    xyz, rgb = visible_points(view, image, depth, np.random.default_rng(0))
    x, y, z = view.K @ (view.viewmat[:3, :3] @ xyz.T + view.viewmat[:3, 3:])
    rows, columns = np.floor(y / z).astype(int), np.floor(x / z).astype(int)
    assert len({*zip(rows.tolist(), columns.tolist(), strict=True)}) == PER_VIEW
    np.testing.assert_allclose(z, depth[rows, columns], rtol=1e-6)
    np.testing.assert_allclose(rgb / 255, image[rows, columns], atol=0.5 / 255 + 1e-6)
