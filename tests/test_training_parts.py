"""What training reads and refuses; its schedule, initial Gaussians, checkpoints, densification and resets."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from gspure.cameras import read_cameras
from gspure.cameras.fitting import Cloud
from gspure.cameras.worlds import in_world_of, shifted
from gspure.constants import SH_DC
from gspure.errors import InputError
from gspure.files import read_json, write_json
from gspure.model import read_model
from gspure.model.gaussians import sigmoid
from gspure.model.ply import offset_comment
from gspure.opencl.trainable import Parameters, TrainState
from gspure.training import densification
from gspure.training.dataset import extent, read_dataset, read_photographs, reduced
from gspure.training.densification import plan, reset_opacities
from gspure.training.fast import schedule_of
from gspure.training.initialization import (
    COMMON_SHARE,
    LEAST_POINTS,
    consistent_points,
    gaussians_at,
    random_points,
    view_counts,
)
from gspure.training.output import Snapshot, read_checkpoint, write_checkpoint, write_output
from gspure.training.schedule import Schedule
from tests.camera_cases import rotation_from
from tests.models import gaussians
from tests.training_cases import blender_scene, colmap_project, ring, same_bits, state, statistics, turned_away

POINTS = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3))


@pytest.fixture
def project(tmp_path):
    return colmap_project(tmp_path / "project", ring(), POINTS)


def refusal(source, scale="native", **settings):
    with pytest.raises(InputError) as caught:
        read_dataset(source, scale, **settings)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("views", "points", "refused"),
    [
        ([turned_away(view) for view in ring()], POINTS, "some that see points, found all look away from them"),
        ([turned_away(view) for view in ring(3)], [], "overlapping ones, or at least 4 points, found neither"),
        (ring(1), POINTS, "several, from different places, found none"),
        (ring(2), POINTS, "several, from different places, found 1 in one place"),
    ],
)
def test_views_from_which_nothing_can_be_trained_are_refused(tmp_path, views, points, refused):
    assert f"training views: expected {refused}" in refusal(colmap_project(tmp_path / "project", views, points))


@pytest.fixture
def blender(tmp_path):
    """Five training views, three of each held-out split, all 32x24."""
    views = ring(11)
    splits = {"train": views[:5], "val": views[5:8], "test": views[8:]}
    return blender_scene(tmp_path / "blender", splits, gaussians(means=POINTS, scales=0.1, opacities=0.9))


@pytest.mark.parametrize(
    ("lists", "train", "test"),
    [
        ({"train": [0, 1, 2], "test": [3, 4]}, [0, 1, 2], [3, 4]),
        ({"train": [0, 1, 2], "val": [4]}, [0, 1, 2], [4]),
        ({"test": [3]}, [0, 1, 2, 4], [3]),
    ],
)
def test_the_file_lists_of_nerfstudio_split_the_views(blender, lists, train, test):
    content = read_json(blender / "transforms_train.json")
    files = [frame["file_path"] for frame in content["frames"]]
    content |= {f"{name}_filenames": [files[i] for i in rows] for name, rows in lists.items()}
    write_json(blender / "transforms.json", content)
    dataset = read_dataset(blender / "transforms.json", "native")
    for views, rows in ((dataset.train, train), (dataset.test, test)):
        assert [view.name for view in views] == [f"train_r_{i}" for i in rows]


@pytest.mark.parametrize("shade", [0.0, 0.4, 1.0])
def test_transparent_photographs_are_composited_on_the_background(blender, shade):
    views = read_dataset(blender, "native").train
    for view, image in zip(views, read_photographs(views, (shade, 0, 1)), strict=True):
        red, _, blue, alpha = np.moveaxis(np.asarray(Image.open(view.image)) / 255, -1, 0)
        assert 0 < alpha.mean() < 0.9
        np.testing.assert_allclose(image[..., 0], red * alpha + shade * (1 - alpha), atol=1.5 / 255)
        np.testing.assert_allclose(image[..., 2], blue * alpha + (1 - alpha), atol=1.5 / 255)


@pytest.mark.parametrize("offset", [(456789, 5432100, 86), (0, 1e4, 0), (-3e7, 3e7, 0)])
def test_a_capture_far_from_the_origin_is_moved_to_it(project, tmp_path, capsys, offset):
    near = read_dataset(project, "native")
    assert not near.offset.any()
    far = read_dataset(colmap_project(tmp_path / "far", shifted(ring(), np.array(offset)), POINTS + offset), "native")
    assert capsys.readouterr().err.count("training around") == 1
    rest = np.array(offset) - far.offset
    assert (np.abs(rest) < 2).all()
    np.testing.assert_allclose(far.xyz, near.xyz + rest, atol=1e-7)
    for there, here in zip(far.train, near.train, strict=True):
        np.testing.assert_allclose(there.centre, here.centre + rest, atol=1e-7)


def test_a_model_around_an_offset_is_seen_by_the_cameras_of_its_capture(tmp_path):
    offset = np.array([456789.0, 5432100, 86])
    source = colmap_project(tmp_path / "far", shifted(ring(), offset), POINTS + offset)
    data = read_dataset(source, "native")
    write_output(tmp_path / "out", data, gaussians_at(data.xyz, data.rgb), 1, (0, 0, 0), place=tmp_path / "out")
    assert read_model(tmp_path / "out").comments == (offset_comment(data.offset),)
    for cameras in (source, tmp_path / "out" / "cameras.json"):
        views = in_world_of(tmp_path / "out", read_cameras(cameras), cameras)
        assert Cloud(read_model(tmp_path / "out")).share_covered(views) > 0.3


def test_photographs_that_exif_data_turn_are_mentioned(project, capsys):
    exif = Image.Exif()
    exif[0x112] = 6
    for number, file in enumerate(sorted((project / "images").iterdir())):
        Image.open(file).save(file.with_suffix(".jpg"), **({"exif": exif} if number < 2 else {}))
        file.unlink()
    read_dataset(project, "native")
    assert "2 of 9 photographs are turned, such as orbit_000: EXIF orientation 6 is ignored" in capsys.readouterr().err
    Image.new("RGB", (24, 32)).save(project / "images" / "orbit_001.jpg", exif=exif)
    assert "orbit_001.image: expected the shape of its camera, 32x24, found 24x32 (EXIF" in refusal(project, "16px")


def times(schedule, what):
    return [i for i in range(1, schedule.iterations + 1) if getattr(schedule, what)(i)]


def test_thirty_thousand_iterations_are_scheduled_as_3dgs_does():
    schedule = Schedule.scaled(30_000)
    assert times(schedule, "densifies") == list(range(600, 15_000, 100))
    assert times(schedule, "resets_opacities") == [3000, 6000, 9000, 12_000]
    assert [schedule.sh_degree(i) for i in (1, 999, 1000, 2000, 3000, 30_000)] == [0, 0, 1, 2, 3, 3]
    assert [schedule.rates(i, extent=2.0).means for i in (0, 15_000)] == pytest.approx([3.2e-4, 3.2e-5], rel=1e-12)
    assert not schedule.prunes_big(3000)
    assert schedule.prunes_big(3100)


@given(st.integers(1, 40_000), st.integers(LEAST_POINTS, 10**6))
def test_a_fast_run_grows_to_full_photographs_all_harmonics_and_the_whole_budget(iterations, most):
    schedule = schedule_of("fast", iterations)
    steps = sorted({*range(1, iterations + 1, max(1, iterations // 50)), iterations})
    reductions = [schedule.reduction(i) for i in steps]
    budgets = [schedule.budget(most, i) for i in steps]
    assert reductions == sorted(reductions, reverse=True)
    assert budgets == sorted(budgets)
    assert (reductions[-1], budgets[-1], schedule.sh_degree(iterations)) == (1, most, 3)
    assert not times(schedule, "resets_opacities")


def test_small_photographs_keep_their_light_and_field_of_view():
    views = ring(2, width=48, height=32)
    images = [np.random.default_rng(i).random((32, 48, 3), np.float32) for i in range(2)]
    smaller, means = reduced(views, images, 4)
    assert means[0].shape == (smaller[0].height, smaller[0].width, 3) == (8, 12, 3)
    np.testing.assert_allclose(means[1].mean(axis=(0, 1)), images[1].mean(axis=(0, 1)), rtol=1e-4)
    corners = [np.linalg.solve(view.K, [view.width, view.height, 1]) for view in (views[1], smaller[1])]
    np.testing.assert_allclose(*corners)


@settings(max_examples=50, deadline=None)
@given(arrays(np.float64, st.tuples(st.integers(4, 30), st.just(3)), elements=st.floats(-100, 100, width=32)))
def test_a_gaussian_is_initialized_with_the_distance_to_its_three_nearest_points(points):
    squared = np.sort(np.square(points[:, None] - points[None]).sum(axis=2), axis=1)[:, 1:4].mean(axis=1)
    grey = np.full((len(points), 3), 128, np.uint8)
    scales = np.exp(gaussians_at(points, grey).log_scales.astype(np.float64))
    np.testing.assert_allclose(scales, np.sqrt(np.maximum(squared, 1e-7))[:, None].repeat(3, axis=1), rtol=1e-5)


def test_gaussians_start_with_the_colours_of_their_points_without_rotation_at_low_opacity():
    rng = np.random.default_rng(0)
    rgb = rng.integers(256, size=(20, 3), dtype=np.uint8)
    points = rng.normal(size=(20, 3))
    initial = gaussians_at(points, rgb)
    np.testing.assert_array_equal(initial.means, points.astype(np.float32))
    np.testing.assert_array_equal(initial.quats, [[1, 0, 0, 0]] * 20)
    np.testing.assert_allclose(sigmoid(initial.opacity_logits), 0.1, rtol=1e-6)
    np.testing.assert_allclose(0.5 + SH_DC * initial.sh_coeffs[:, 0], rgb / 255, atol=1e-6)
    assert initial.sh_coeffs.shape == (20, 16, 3)
    assert not initial.sh_coeffs[:, 1:].any()


def test_random_points_lie_where_many_views_overlap():
    views = ring()
    points = random_points(views, extent(views), 500, np.random.default_rng(0))
    assert points.shape == (500, 3)
    assert view_counts(points, views).min() >= COMMON_SHARE * len(views)


def test_consistent_points_lie_at_the_surface_that_all_views_show():
    views = ring()

    def photograph(view):  # of the plane y = 0, whose colour is its place
        line, column = np.indices((view.height, view.width)) + 0.5
        pixels = np.stack([column, line, np.ones_like(line)]).reshape(3, -1)
        rays = np.linalg.inv(view.K @ view.viewmat[:3, :3]) @ pixels
        ground = view.centre[:, None] - rays * view.centre[1] / rays[1]
        return np.sin(ground / 2 + [[0], [2], [4]]).T.reshape(view.height, view.width, 3).astype(np.float32) / 2 + 0.5

    points, _ = consistent_points(views, [photograph(view) for view in views], extent(views), np.random.default_rng(0))
    anywhere = random_points(views, extent(views), len(points), np.random.default_rng(0))
    assert np.median(np.abs(points[:, 1])) < np.median(np.abs(anywhere[:, 1])) / 2


SETTINGS = {"iterations": 100, "seed": 3, "background": (0.0, 0.5, 1.0), "max_gaussians": None, "data": "abc"}


@pytest.mark.parametrize("content", [b"", b"half", {"run": np.array("{}")}, {"run": np.array([{}], dtype=object)}])
def test_a_file_that_is_not_a_checkpoint_is_refused(tmp_path, content):
    snapshot = Snapshot(42, state(11), (3, 1, 2), np.random.default_rng(7).bit_generator.state)
    path = tmp_path / "checkpoint.npz"
    write_checkpoint(path, snapshot, SETTINGS)
    if isinstance(content, bytes):
        path.write_bytes(content and path.read_bytes()[:4000])
    else:
        np.savez(path, **content)
    with pytest.raises(InputError, match=r"checkpoint\.npz: [a-z.]+: expected"):
        read_checkpoint(path, SETTINGS)


SMALL = 1e-4  # a mean gradient below the threshold
LARGE = 3e-4  # above it


def opaque(count, size=0.05, **columns):
    """A state in which nothing is pruned, with random moments; `columns` replace parameters."""
    random = state(count, size=size)
    logits = np.full(count, 2.0, np.float32)
    parameters = Parameters(**{**vars(random.parameters), "opacity_logits": logits, **columns})
    return TrainState(parameters, random.first, random.second)


def grow(before, gradients, views=1, **settings):
    settings |= {"extent": 1.0, "prune_big": False, "rng": np.random.default_rng(0)}
    return densification.grow(before, plan(before.parameters, statistics(gradients, views), **settings))


def rows_of(before, rows):
    return TrainState(*(Parameters(*(array[rows] for array in vars(part).values())) for part in vars(before).values()))


def test_a_gradient_is_the_mean_over_the_views_that_show_the_gaussian():
    before = opaque(3, size=0.001)
    after = grow(before, [LARGE, SMALL, 0.0], views=[10, 10, 0])
    assert len(after.parameters) == 4
    np.testing.assert_array_equal(after.parameters.means[3], before.parameters.means[0])


def test_a_small_gaussian_is_cloned_and_the_clone_starts_without_moments():
    before = opaque(4, size=0.001)
    after = grow(before, [SMALL, LARGE, SMALL, LARGE])
    assert same_bits(rows_of(after, slice(4)), before)
    clones = rows_of(after, slice(4, None))
    for name, array in vars(clones.parameters).items():
        np.testing.assert_array_equal(array, getattr(before.parameters, name)[[1, 3]])
    assert not any(array.any() for part in (clones.first, clones.second) for array in vars(part).values())


def test_a_large_gaussian_is_split_into_two_smaller_ones():
    before = opaque(4, size=0.5)
    after = grow(before, [SMALL, LARGE, SMALL, LARGE])
    assert same_bits(rows_of(after, slice(2)), rows_of(before, [0, 2]))
    halves = rows_of(after, slice(2, None))
    parents = rows_of(before, [1, 3, 1, 3])
    shrunk = np.exp(parents.parameters.log_scales) / 1.6
    np.testing.assert_allclose(np.exp(halves.parameters.log_scales), shrunk, rtol=1e-5)
    for name in ("quats", "opacity_logits", "sh_coeffs"):
        np.testing.assert_array_equal(getattr(halves.parameters, name), getattr(parents.parameters, name))
    assert not any(array.any() for part in (halves.first, halves.second) for array in vars(part).values())


def test_split_gaussians_are_sampled_from_their_parent():
    count = 20_000
    quat = np.array([0.7, -0.5, 0.9, 0.2])
    scales = np.array([0.5, 0.1, 0.03])
    parents = opaque(
        count,
        means=np.zeros((count, 3), np.float32) + np.float32(2),
        quats=np.tile(quat, (count, 1)).astype(np.float32),
        log_scales=np.tile(np.log(scales), (count, 1)).astype(np.float32),
    )
    drawn = grow(parents, np.full(count, LARGE)).parameters.means.astype(np.float64)
    assert len(drawn) == 2 * count
    rotation = rotation_from(quat)
    np.testing.assert_allclose(drawn.mean(axis=0), 2, atol=0.02)
    np.testing.assert_allclose(np.cov(drawn.T), rotation @ np.diag(scales**2) @ rotation.T, atol=0.005)


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 40), st.integers(0, 90), st.sampled_from([0.001, 0.02, 0.5]), st.integers(0, 9))
def test_growth_is_bounded_and_prefers_the_largest_gradients(count, bound, size, seed):
    before = opaque(count, size=size)
    gradients = np.random.default_rng(seed).permutation(np.linspace(0, 2 * LARGE, count))
    after = grow(before, gradients, max_gaussians=bound)
    wanted = int((gradients >= 2e-4).sum())
    grown = min(wanted, max(0, bound - count))
    assert len(after.parameters) == count + grown
    parents = np.argsort(-gradients)[:grown]
    others = np.setdiff1d(np.arange(count), parents)
    kept = {mean.tobytes() for mean in after.parameters.means}
    assert all(before.parameters.means[row].tobytes() in kept for row in others)


def test_a_reset_lowers_opacities_and_clears_only_their_moments():
    before = state(30)
    after = reset_opacities(before)
    old, new = (1 / (1 + np.exp(-s.parameters.opacity_logits.astype(float))) for s in (before, after))
    np.testing.assert_allclose(new, np.minimum(old, 0.01), rtol=1e-5)
    for part in ("first", "second"):
        assert not getattr(after, part).opacity_logits.any()
    for part in vars(before):
        for name in ("means", "quats", "log_scales", "sh_coeffs"):
            np.testing.assert_array_equal(getattr(getattr(after, part), name), getattr(getattr(before, part), name))
