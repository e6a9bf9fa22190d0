"""Figures: the data behind the pictures, and that pictures show something."""

import base64
import json
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from gspure.artifacts import save_array
from gspure.cameras import Camera, intrinsics, orbit_cameras, write_cameras
from gspure.cli import main
from gspure.clustering.store import Clusters, write_clusters
from gspure.evaluation.comparison import ViewMetrics
from gspure.evaluation.outcomes import Outcome
from gspure.figures import export, gallery, panels, plots, portrait, style, viewpoint, zbuffer
from gspure.figures.clouds import Cloud, cluster_cloud, kept_cloud, rank_cloud, truth_cloud
from gspure.figures.eyedome import eye_dome
from gspure.figures.probe import gl_problem
from gspure.images import write_image
from gspure.model import write_model
from tests.models import gaussians

RNG = np.random.default_rng(3)
BALL = RNG.normal(size=(400, 3)).astype(np.float32)
PNG = b"\x89PNG\r\n"


def colour(cloud: Cloud, row: int) -> tuple[int, ...]:
    return tuple(int(c) for c in cloud.colours[row])


def hexadecimal(text: str) -> tuple[int, ...]:
    return tuple(bytes.fromhex(text[1:]))


# --- Colours ----------------------------------------------------------------------------------------------------------


def test_the_largest_clusters_have_a_colour_each_smaller_ones_share_tints_and_noise_is_grey() -> None:
    sizes = [30 - i for i in range(len(style.CLUSTERS) + 3)]
    labels = np.concatenate([np.repeat(np.arange(len(sizes)), sizes), [-1, -1]]).astype(np.int32)
    relabelled = np.where(labels < 0, -1, len(sizes) - 1 - labels).astype(np.int32)  # the largest comes last by number
    for named in (labels, relabelled):
        cloud = cluster_cloud(np.zeros((len(labels), 3), np.float32), named)
        starts = np.cumsum([0, *sizes])
        assert [colour(cloud, i) for i in starts[: len(style.CLUSTERS)]] == [hexadecimal(c) for c in style.CLUSTERS]
        assert colour(cloud, starts[len(style.CLUSTERS)]) == hexadecimal(style.tint(style.CLUSTERS[0], 0.5))
        assert colour(cloud, -1) == hexadecimal(style.NOISE)


@given(arrays(np.int32, st.integers(1, 60), elements=st.integers(-1, 14)))
def test_shares_in_the_legend_of_clusters_add_up(labels: np.ndarray) -> None:
    _, labels = np.unique(np.append(labels, -1), return_inverse=True)  # dense, with noise
    labels = (labels - 1).astype(np.int32)
    legend = [entry for row in cluster_cloud(np.zeros((len(labels), 3), np.float32), labels).legend for entry in row]
    shares = [float(label.rpartition(" ")[2].rstrip("%")) for label, _ in legend]
    assert sum(shares) == pytest.approx(100, abs=0.05 * len(shares) + 1e-9)


@given(arrays(np.float32, 40, elements=st.floats(0, 9, width=16)), arrays(np.int32, 40, elements=st.integers(-1, 1)))
def test_the_rank_is_that_of_the_weight_that_decides(weights: np.ndarray, labels: np.ndarray) -> None:
    labels[:2] = 0, 1
    rank = rank_cloud(np.zeros((40, 3), np.float32), labels, weights).scalars["rank"]
    deciding = weights.astype(np.float64)
    for cluster in (0, 1):
        deciding[labels == cluster] = weights[labels == cluster].mean(dtype=np.float64)
        assert np.ptp(rank[labels == cluster]) == 0
    for k in range(40):
        before, tied = np.sum(deciding < deciding[k]), np.sum(deciding == deciding[k])
        assert rank[k] == pytest.approx((before + (tied - 1) / 2) / 39)


def test_low_and_high_ranks_have_the_ends_of_the_scale() -> None:
    cloud = rank_cloud(BALL[:3], np.full(3, -1, np.int32), np.array([5, 0, 1], np.float32))
    assert colour(cloud, 1) == (68, 1, 84)  # viridis
    assert colour(cloud, 0) == (253, 231, 36)
    assert cloud.scale
    assert not cloud.legend


def test_pruned_gaussians_and_carriers_of_the_message_stand_out() -> None:
    mask = np.array([True, False, False, False])
    for cloud, true, false in (
        (kept_cloud(BALL[:4], mask), style.PRUNED, style.KEPT),
        (truth_cloud(BALL[:4], mask), style.MESSAGE, style.KEPT),
    ):
        assert [colour(cloud, k) for k in range(4)] == [hexadecimal(c) for c in (true, false, false, false)]
        assert [label.rpartition(": ")[2] for label, _ in cloud.legend[0]] == ["75.0%", "25.0%"]


def test_a_subset_keeps_points_colours_and_scalars_together() -> None:
    weights = RNG.random(400, np.float32)
    cloud = rank_cloud(BALL, np.full(400, -1, np.int32), weights)
    rows = np.array([7, 3, 99])
    part = cloud.subset(rows)
    assert np.array_equal(part.points, BALL[rows])
    assert np.array_equal(part.colours, cloud.colours[rows])
    assert np.array_equal(part.scalars["weight"], weights[rows])
    assert part.scale == cloud.scale


# --- Views ------------------------------------------------------------------------------------------------------------


def looking_at(target: np.ndarray, eye: np.ndarray, down: tuple[float, ...] = (0, 1, 0), name: str = "view") -> Camera:
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(down, forward)
    right /= np.linalg.norm(right)
    viewmat = np.eye(4)
    viewmat[:3, :3] = np.stack([right, np.cross(forward, right), forward])
    viewmat[:3, 3] = -viewmat[:3, :3] @ eye
    return Camera(name, 64, 48, intrinsics(50, 50, 32, 24), viewmat)


@given(arrays(np.float64, 3, elements=st.floats(-50, 50)), st.floats(0.01, 100), st.integers(0, 1000))
def test_an_overview_holds_every_point_that_is_no_floater(centre: np.ndarray, size: float, seed: int) -> None:
    points = centre + size * np.random.default_rng(seed).uniform(-1, 1, (200, 3))
    camera = viewpoint.overview(points, viewpoint.world_axes(points, []))
    assert len(viewpoint.in_view(points, camera)) == 200
    pixels, _ = viewpoint.project(points, camera)
    filled = np.ptp(pixels, axis=0) / (camera.width, camera.height)
    assert filled.max() > 0.9


def test_far_floaters_do_not_change_the_overview() -> None:
    axes = viewpoint.world_axes(BALL, [])
    floaters = np.array([[1e4, 0, 0], [0, -1e4, 0], [0, 0, 1e5]], np.float32)
    clean, dirty = viewpoint.overview(BALL, axes), viewpoint.overview(np.concatenate([BALL, floaters]), axes)
    assert np.linalg.norm(clean.centre - dirty.centre) < 0.1 * np.linalg.norm(clean.centre)


@pytest.mark.parametrize("points", [np.ones((1, 3)), np.full((5, 3), -3.0), np.outer(np.arange(4), [1, 1, 1])])
def test_degenerate_clouds_have_an_overview_too(points: np.ndarray) -> None:
    camera = viewpoint.overview(points, viewpoint.world_axes(points, []))
    assert len(viewpoint.in_view(points, camera)) == len(points)


def test_up_is_up_in_an_overview_whatever_the_cameras_call_up() -> None:
    for down in ((0, 1, 0), (0, 0, -1)):
        around = [np.array([np.cos(a), np.sin(a)]) * 5 for a in np.arange(6)]
        level = [np.insert(xy, abs(np.array(down)).argmax(), 0.0) for xy in around]
        cameras = [looking_at(np.zeros(3), eye, down) for eye in level]
        axes = viewpoint.world_axes(BALL, cameras)
        assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1)
        assert axes[1] == pytest.approx(-np.array(down), abs=1e-9)
        camera = viewpoint.overview(BALL, axes)
        high, low = viewpoint.project(np.array([axes[1], -axes[1]]), camera)[0]
        assert high[1] < low[1]  # rows count downwards


def test_the_front_is_where_the_cameras_stand() -> None:
    eyes = [np.array([x, 0.0, 6.0]) for x in (-1, 0, 1)]
    cameras = [looking_at(np.zeros(3), eye) for eye in eyes]
    assert viewpoint.world_axes(BALL, cameras)[2] == pytest.approx([0, 0, 1], abs=0.05)
    assert viewpoint.world_axes(BALL, [])[2] == pytest.approx([0, 0, -1])
    ring = orbit_cameras(BALL, np.ones(400), count=12, up=(0, 0, 1))
    assert viewpoint.world_axes(BALL, ring)[2] == pytest.approx([0, -1, 0], abs=0.05)


def test_a_room_is_seen_from_the_inside_view_that_sees_most_and_an_object_from_outside() -> None:
    shell = 5 * BALL / np.linalg.norm(BALL, axis=1, keepdims=True)
    dense = np.concatenate([shell, shell[shell[:, 0] > 3] * 0.99])
    inside = [looking_at(np.array([x, 0.0, 0.0]), np.array([0.1, 0, 0]), name=f"view_{x}") for x in (-9.0, 9.0)]
    assert viewpoint.choose(dense, inside).name == "view_9.0"
    assert viewpoint.choose(dense, orbit_cameras(dense, np.ones(len(dense)))).name == "overview"
    assert viewpoint.choose(dense, []).name == "overview"


def test_points_behind_beside_or_right_before_the_camera_are_not_drawn() -> None:
    wall = np.column_stack([RNG.uniform(-1, 1, (100, 2)), np.full(100, 5.0)])
    stray = np.array([[0, 0, -5], [99, 0, 5], [0.01, 0, 0.1], [0, 0, 500], [0, 0, 0]])
    camera = Camera("view", 64, 48, intrinsics(50, 50, 32, 24), np.eye(4))
    assert viewpoint.in_view(np.concatenate([wall, stray]), camera).tolist() == list(range(100))


def test_pictures_have_square_pixels() -> None:
    camera = Camera("view", 100, 50, intrinsics(80, 40, 50, 25), np.eye(4))
    fitted = viewpoint.fitted(camera, 200)
    assert (fitted.width, fitted.height) == (200, 200)
    assert fitted.K[0, 0] == fitted.K[1, 1]


def test_large_clouds_are_thinned_always_to_the_same_points(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewpoint, "MAX_POINTS", 50)
    rows = viewpoint.thinned(1000)
    assert len(rows) == 50
    assert (np.diff(rows) > 0).all()
    assert np.array_equal(rows, viewpoint.thinned(1000))
    assert np.array_equal(viewpoint.thinned(50), np.arange(50))


# --- Pictures ---------------------------------------------------------------------------------------------------------

needs_gl = pytest.mark.skipif(gl_problem() is not None, reason=f"no OpenGL: {gl_problem()}")
NEAR_AND_FAR = Cloud(
    np.array([[0, 0, 4], [0, 0, 8], [1.2, 0.7, 6]], np.float32),
    np.array([[200, 0, 0], [0, 200, 0], [0, 0, 200]], np.uint8),
    {},
)
ASKEW = Camera("view", 120, 80, intrinsics(100, 100, 45, 50), np.eye(4))


def test_the_nearest_dot_wins() -> None:
    image, depth = zbuffer.draw(NEAR_AND_FAR, ASKEW, 6)
    assert image[50, 45].tolist() == [200, 0, 0]
    assert depth[50, 45] == 4
    assert image[0, 0].tolist() == [255, 255, 255]
    assert np.isinf(depth[0, 0])
    assert image[round(50 + 100 * 0.7 / 6), round(45 + 100 * 1.2 / 6)].tolist() == [0, 0, 200]


def test_eye_dome_darkens_what_stands_behind_an_edge_and_nothing_else() -> None:
    depth = np.full((20, 30), 2.0, np.float32)
    depth[:, 15:] = 4.0
    depth[:5] = np.inf
    image = np.full((20, 30, 3), 200, np.uint8)
    shaded = eye_dome(image, depth, 2)
    assert (shaded[:5] == 200).all()
    assert (shaded[5:, :15] == 200).all()
    assert (shaded[7:18, 15:17] < 150).all()
    assert (shaded[5:, 18:] == 200).all()


@pytest.mark.parametrize("opengl", [False, pytest.param(True, marks=needs_gl)])
def test_a_portrait_shows_the_cloud_in_its_colours_on_white(opengl: bool) -> None:
    camera = viewpoint.fitted(viewpoint.overview(BALL, viewpoint.world_axes(BALL, [])), 480)
    pruned = BALL[:, 0] > 0
    image = portrait.portrait(kept_cloud(BALL, pruned), camera, opengl=opengl).astype(int)
    assert image.shape == (camera.height, camera.width, 3)
    covered = (image < 250).any(axis=-1)
    assert 0.02 < covered.mean() < 0.9
    orange = image[..., 0] > image[..., 2] + 40
    blue = image[..., 2] > image[..., 0] + 10
    assert orange.sum() > 0.1 * covered.sum()
    assert blue.sum() > 0.1 * covered.sum()
    again = portrait.portrait(kept_cloud(BALL, pruned), camera, opengl=opengl)
    assert np.array_equal(image, again)


@needs_gl
def test_both_ways_of_drawing_put_every_dot_in_the_same_place() -> None:
    camera = ASKEW.resized(480, 320)
    pictures = [portrait.portrait(NEAR_AND_FAR, camera, opengl=opengl).astype(int) for opengl in (False, True)]
    for channel in (0, 2):
        others = [c for c in range(3) if c != channel]
        centres = []
        for picture in pictures:
            mine = picture[..., channel] > picture[..., others].max(axis=-1) + 30
            centres.append(np.argwhere(mine).mean(axis=0))
        assert centres[0] == pytest.approx(centres[1], abs=0.6)


def test_a_camera_that_sees_nothing_gives_a_white_picture() -> None:
    away = Camera("view", 20, 10, intrinsics(10, 10, 10, 5), np.diag([-1.0, 1, -1, 1]))
    assert (portrait.portrait(NEAR_AND_FAR, away, opengl=False) == 255).all()


# --- Files ------------------------------------------------------------------------------------------------------------


def test_gltf_holds_points_colours_and_scalars_with_up_as_y(tmp_path: Path) -> None:
    weights = RNG.random(400, np.float32)
    cloud = rank_cloud(BALL, np.full(400, -1, np.int32), weights)
    axes = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # z is up
    export.write_gltf(tmp_path / "ranks.gltf", cloud, axes)
    document = json.loads((tmp_path / "ranks.gltf").read_text())
    data = base64.b64decode(document["buffers"][0]["uri"].partition(",")[2])
    assert len(data) == document["buffers"][0]["byteLength"]
    found = {}
    for name, index in document["meshes"][0]["primitives"][0]["attributes"].items():
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        dtype = {5126: "<f4", 5123: "<u2"}[accessor["componentType"]]
        raw = data[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        found[name] = np.frombuffer(raw, dtype).reshape(accessor["count"], -1)
    assert np.array_equal(found["POSITION"], BALL)
    assert np.array_equal(found["_WEIGHT"][:, 0], weights)
    linear = found["COLOR_0"] / 65535
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    assert np.rint(255 * srgb[:, :3]) == pytest.approx(cloud.colours)
    assert (found["COLOR_0"][:, 3] == 65535).all()
    matrix = np.array(document["nodes"][0]["matrix"]).reshape(4, 4).T
    assert (matrix @ [0, 0, 1, 0]).tolist() == [0, 1, 0, 0]
    assert document["accessors"][0]["min"] == BALL.min(axis=0).tolist()


def test_vtp_holds_points_colours_and_scalars(tmp_path: Path) -> None:
    import pyvista as pv

    labels = RNG.integers(-1, 4, 400).astype(np.int32)
    cloud = cluster_cloud(BALL, labels)
    export.write_vtp(tmp_path / "clusters.vtp", cloud)
    mesh = pv.read(tmp_path / "clusters.vtp")
    assert np.array_equal(mesh.points, BALL)
    assert np.array_equal(mesh["rgb"], cloud.colours)
    assert np.array_equal(mesh["cluster"], labels)


@pytest.fixture
def evidence(monkeypatch: pytest.MonkeyPatch) -> gallery.Evidence:
    monkeypatch.setattr(gallery, "PICTURE_WIDTH", 120)
    labels = np.repeat([-1, 0, 1, -1], 100).astype(np.int32)
    weights = np.where(np.arange(400) < 50, 0, RNG.random(400)).astype(np.float32)
    return gallery.Evidence(BALL, labels, weights, weights < 0.1, weights < 0.2)


def test_without_opengl_all_figures_are_drawn_and_say_why(
    tmp_path: Path, evidence: gallery.Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gallery, "gl_problem", lambda: "no driver: install one")
    monkeypatch.setattr(portrait, "_draw_balls", None)
    captions = gallery.draw(tmp_path / "figures", evidence)
    clouds = ("clusters", "ranks", "kept", "truth")
    expected = {f"{name}{suffix}" for name in clouds for suffix in (".png", ".gltf", ".vtp")} | {"weights.png"}
    assert {path.name for path in (tmp_path / "figures").iterdir()} == expected
    assert {path.stem for path in captions} == {*clouds, "weights"}
    for path, caption in captions.items():
        assert path.read_bytes().startswith(PNG)
        assert ("Drawn without OpenGL (no driver: install one)." in caption) == (path.stem != "weights")


def test_figures_are_the_same_bytes_again(tmp_path: Path, evidence: gallery.Evidence) -> None:
    for folder in "ab":
        gallery.draw(tmp_path / folder, evidence)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes(), path.name


# --- Charts -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list:
    """The figures that were written, as matplotlib objects."""
    kept, original = [], style.page

    @contextmanager
    def page(*args, **kwargs):
        with original(*args, **kwargs) as figure:
            kept.append(figure)
            yield figure

    monkeypatch.setattr(style, "page", page)
    return kept


@pytest.mark.parametrize(("tau_c", "tau_n", "lines"), [(4.0, 4.0, [1, 4]), (4.0, 2.0, [1, 4, 2])])
def test_the_histogram_shows_every_gaussian_and_the_thresholds(tmp_path: Path, drawn, tau_c, tau_n, lines) -> None:
    weights = np.concatenate([np.zeros(30), np.geomspace(1e-6, 1e3, 70)]).astype(np.float32)
    pruned = weights < 0.1
    plots.write_weight_histogram(tmp_path / "weights.png", weights, pruned, tau_c, tau_n)
    axes = drawn[0].axes[0]
    steps = [patch for patch in axes.patches if hasattr(patch, "get_data")]
    spread = [np.sum(data.values - data.baseline) for data in (patch.get_data() for patch in steps)]
    at_zero = [bar.get_height() for container in axes.containers for bar in container]
    assert np.add(spread, at_zero) == pytest.approx([100 * np.mean(~pruned), 100 * np.mean(pruned)])
    assert at_zero == pytest.approx([0, 30])
    marked = [10 ** line.get_xdata()[0] for line in axes.lines]
    assert marked == pytest.approx([weights.mean(dtype=np.float64) / tau for tau in lines])
    assert "0" in [label.get_text() for label in axes.get_xticklabels()]


@pytest.mark.parametrize("weights", [np.zeros(3), np.ones(1), np.full(4, 1e-30)])
def test_odd_weights_have_a_histogram_too(tmp_path: Path, weights: np.ndarray) -> None:
    weights = weights.astype(np.float32)
    plots.write_weight_histogram(tmp_path / "weights.png", weights, weights == 0, 4, 4)
    assert (tmp_path / "weights.png").read_bytes().startswith(PNG)


def outcome(variant: str, scene: float, message: float | None = None, scheme: str = "planted") -> Outcome:
    targets, reference = {"scene": ViewMetrics("scene", "mean", scene, 0.9)}, {}
    if message is not None:
        targets["message"] = ViewMetrics("message", "mean", message, 0.8)
        reference = {name: ViewMetrics(name, "mean", 30.0, 1.0) for name in targets}
    return Outcome(scheme, "room", variant, targets, dict.fromkeys(targets, 3), reference=reference)


def texts(figure) -> list[str]:
    return [text.get_text() for text in figure.axes[0].texts]


def test_outcomes_show_both_targets_and_the_score(tmp_path: Path, drawn) -> None:
    plots.write_outcomes(tmp_path / "outcomes.png", [outcome("watermarked", 30, 30), outcome("gspure", 29, 12.5)])
    bars = [[bar.get_width() for bar in container] for container in drawn[0].axes[0].containers]
    assert bars == [[30, 29], [30, 12.5]]
    assert {"+0.00", "+16.50", "Score"} <= set(texts(drawn[0]))
    assert [label.get_text() for label in drawn[0].axes[0].get_yticklabels()] == ["watermarked", "GSPure"]


def test_outcomes_without_a_key_show_the_scene_alone(tmp_path: Path, drawn) -> None:
    plots.write_outcomes(tmp_path / "outcomes.png", [outcome("watermarked", np.inf), outcome("gspure", 29)])
    assert len(drawn[0].axes[0].containers) == 1
    assert "identical" in texts(drawn[0])
    assert "Score" not in texts(drawn[0])


def test_panels_name_the_views_and_the_psnr_against_the_first_column(tmp_path: Path, drawn) -> None:
    black = {name: np.zeros((8, 10, 3), np.float32) for name in ("a", "b")}
    grey = {name: image + np.float32(0.1) for name, image in black.items()}
    panels.write_panels(tmp_path / "panels.png", {"truth": black, "gspure": grey}, ["a", "b"], difference=True)
    axes = drawn[0].axes
    assert [ax.get_title() for ax in axes] == ["truth", "GSPure", "|difference| × 5", "", "", ""]
    assert [ax.get_xlabel() for ax in axes] == ["a", "20.00 dB", "", "b", "20.00 dB", ""]
    assert np.ptp(axes[2].images[0].get_array() - 0.5) < 1e-6


# --- Command ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def inputs(tmp_path: Path, evidence: gallery.Evidence) -> list[str]:
    files = {name: tmp_path / name for name in ("model.ply", "omega.npy", "clusters.npz", "mask.npy", "cameras.json")}
    write_model(files["model.ply"], gaussians(means=BALL, scales=0.1))
    save_array(files["omega.npy"], evidence.weights)
    write_clusters(files["clusters.npz"], Clusters(evidence.labels, 0), {})
    save_array(files["mask.npy"], evidence.pruned)
    write_cameras(files["cameras.json"], orbit_cameras(BALL, np.ones(400), count=4, width=32, height=24))
    options = ("--model", "--weights", "--clusters", "--prune-mask", "--cameras")
    words = [word for pair in zip(options, map(str, files.values()), strict=True) for word in pair]
    return ["figures", "model", *words, "--out", str(tmp_path / "figures")]


def test_figures_of_a_model_have_their_captions_beside_them(tmp_path: Path, inputs: list[str]) -> None:
    assert main([*inputs, "--view", "orbit_001"]) == 0
    assert (tmp_path / "figures" / "kept.gltf").exists()
    note = json.loads((tmp_path / "figures" / "kept.png.json").read_text())
    assert "Gaussians are pruned" in note["settings"]["caption"]
    assert note["inputs"].keys() == {"model", "weights", "clusters", "prune_mask", "cameras"}


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (["--view", "nowhere"], "cameras.json: view: expected one named nowhere"),
        (["--prune-mask", "{}/short.npy"], "short.npy: array: expected bool [400], found bool [3]"),
        (["--truth", "{}/absent.npy"], "absent.npy: file: expected an existing .npy file"),
    ],
)
def test_what_does_not_fit_the_model_is_told_in_one_line(tmp_path: Path, inputs, capsys, change, told) -> None:
    save_array(tmp_path / "short.npy", np.zeros(3, bool))
    assert main([*inputs, *(word.format(tmp_path) for word in change)]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
    assert not (tmp_path / "figures").exists()


def test_panels_take_the_views_that_all_columns_have(tmp_path: Path, capsys) -> None:
    for folder, names in (("before", "abcde"), ("after", "bcdef")):
        for name in names:
            write_image(tmp_path / folder / f"{name}.png", np.full((6, 8, 3), ord(name) / 255, np.float32))
    columns = [f"--column={folder}={tmp_path / folder}" for folder in ("before", "after")]
    assert main(["figures", "panels", *columns, "--rows", "2", "--out", str(tmp_path / "panels.png")]) == 0
    note = json.loads((tmp_path / "panels.png.json").read_text())
    assert note["inputs"].keys() == {"before b", "before e", "after b", "after e"}
    assert "2 of 4 views" in note["settings"]["caption"]
    with Image.open(tmp_path / "panels.png") as image:
        assert image.width == style.PAGE * style.DPI

    (tmp_path / "empty").mkdir()
    assert main(["figures", "panels", *columns, f"--column=x={tmp_path / 'empty'}", "--out", "x.png"]) == 2
    assert "expected a view that all columns have" in capsys.readouterr().err
