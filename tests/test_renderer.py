"""The renderer against the reference, and its invariants, on every OpenCL device at hand, in both kernel styles."""

import os
import signal
from concurrent.futures import ThreadPoolExecutor
from copy import copy

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gspure.constants import NEAR_PLANE
from gspure.errors import InputError
from gspure.renderer import CONTRIBUTION, Renderer
from tests.comparison import assert_contributions_agree, assert_depths_agree, assert_pixels_agree
from tests.models import AWKWARD, UNDRAWN, blobs, camera, gaussians, joined, tilted_camera
from tests.reference.blending import render

ROUNDING = {("needles", "ray"): 5e-5}
"""Tolerances of cases that float32 cannot hold better: a fiftieth of a pixel wide, 1e-6 of a pixel off at best."""


def assert_all_agree(renderer, view, *, tight=5e-6, background=(0.1, 0.5, 0.9)):
    """Compare every product of `renderer` with the reference."""
    expected = render(renderer.model, view, renderer.energy, background=background)
    spread = max(expected.channels.max(), 1.0)
    assert_pixels_agree(
        renderer.image(view, background), expected.channels, expected.margins, spread=spread, tight=tight
    )
    assert_pixels_agree(renderer.transmittance(view), expected.transmittance, expected.margins, tight=tight)
    assert_depths_agree(renderer.depth(view), expected.depth, expected.margins, tight=tight)
    assert_contributions_agree(renderer.contributions(view), expected, tight=tight)


def everything(renderer, view):
    """Every product of a view, to be compared bit by bit."""
    features = np.random.default_rng(0).normal(size=(len(renderer.model), 5)).astype(np.float32)
    return [
        renderer.image(view),
        renderer.feature_map(view, features),
        renderer.transmittance(view),
        renderer.depth(view),
        renderer.contributions(view),
    ]


def assert_same_bits(first, second):
    for a, b in zip(first, second, strict=True):
        assert a.dtype == b.dtype
        assert a.tobytes() == b.tobytes()


@pytest.mark.parametrize("case", AWKWARD)
def test_awkward_models_agree_with_the_reference(device, style, energy, case):
    model, view = AWKWARD[case]()
    tight = ROUNDING.get((case, energy), 5e-6)
    assert_all_agree(Renderer(model, device, energy=energy, style=style), view, tight=tight)


@pytest.mark.parametrize("count", [1, 15, 16, 17, 257])
def test_any_number_of_gaussians_agrees(device, style, energy, count):
    assert_all_agree(Renderer(blobs(count, count), device, energy=energy, style=style), tilted_camera(33, 31))


@pytest.mark.parametrize("size", [(1, 1), (15, 17), (16, 16), (17, 15), (33, 31), (65, 47)], ids="{0[0]}x{0[1]}".format)
def test_any_image_size_agrees(device, style, energy, size):
    """One short of a tile, a tile, and one more, in both directions."""
    assert_all_agree(Renderer(blobs(120, 1), device, energy=energy, style=style), tilted_camera(*size))


@pytest.mark.parametrize("sh_degree", [0, 1, 2, 3])
def test_any_degree_of_spherical_harmonics_agrees(device, style, sh_degree):
    model, view = blobs(60, 2, sh_degree=sh_degree), tilted_camera(33, 31)
    expected = render(model, view, "ewa")
    image = Renderer(model, device, style=style).image(view)
    assert_pixels_agree(image, expected.channels, expected.margins, spread=expected.channels.max())


@pytest.mark.parametrize("channels", [1, 3, 16, 17])
def test_any_number_of_channels_agrees_with_a_background_for_each(device, style, energy, channels):
    rng = np.random.default_rng(channels)
    model, view = blobs(60, 3, sh_degree=0), camera(33, 31)
    features = rng.normal(size=(60, channels)).astype(np.float32)
    background = rng.normal(size=channels)
    expected = render(model, view, energy, features, background)
    feature_map = Renderer(model, device, energy=energy, style=style).feature_map(view, features, background)
    spread = max(np.ptp(features), np.ptp(background))
    assert_pixels_agree(feature_map, expected.channels, expected.margins, spread=spread)


@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**31),
    count=st.integers(1, 80),
    size=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    largest=st.floats(0.05, 3.0),
    focal=st.floats(10.0, 200.0),
)
def test_random_scenes_agree(device, style, energy, seed, count, size, largest, focal):
    model = blobs(count, seed, sh_degree=0, size=(0.02, largest))
    assert_all_agree(Renderer(model, device, energy=energy, style=style), tilted_camera(*size, focal=focal), tight=2e-5)


def test_the_near_plane_belongs_to_what_is_culled(device, style, energy):
    near = np.float32(NEAR_PLANE)
    depths = np.array([np.nextafter(near, np.float32(0)), near, np.nextafter(near, np.float32(1))])
    means = np.stack([np.zeros(3), np.zeros(3), depths], axis=1)
    renderer = Renderer(gaussians(means=means, scales=0.01), device, energy=energy, style=style)
    assert renderer.contributions(camera(17, 17))["index"].tolist() == [2]


def test_nothing_in_sight_leaves_the_background(device, style, energy):
    model = gaussians(means=[[0, 0, -4], [900, 0, 4]], scales=0.1)
    renderer, view = Renderer(model, device, energy=energy, style=style), camera(17, 5)
    assert (renderer.image(view, (0.25, 0.5, 0.75)) == np.float32([0.25, 0.5, 0.75])).all()
    assert (renderer.image(view) == 0).all()
    assert (renderer.feature_map(view, np.ones((2, 5), np.float32)) == 0).all()
    assert (renderer.transmittance(view) == 1).all()
    assert np.isinf(renderer.depth(view)).all()
    assert renderer.contributions(view).shape == (0,)
    assert renderer.contributions(view).dtype == CONTRIBUTION


def test_an_image_on_white_after_one_on_black_is_the_one_rendered_anew(device, style, energy):
    model, view, white = blobs(17, 4), camera(33, 31), (1.0, 1.0, 1.0)
    renderer = Renderer(model, device, energy=energy, style=style)
    anew = renderer.image(view, white)
    on_black = renderer.image(view)
    assert_same_bits([renderer.image(view, white)], [anew])
    assert (anew > on_black).any()


@pytest.mark.parametrize("columns", UNDRAWN, ids=" ".join)
def test_a_row_that_cannot_be_drawn_changes_nothing(device, style, energy, columns):
    model, view = blobs(17, 4), camera(33, 31)
    broken = model.with_columns(columns | {"opacity": columns.get("opacity", 3.0)})[np.arange(17) < 3]
    alone = Renderer(model, device, energy=energy, style=style)
    among = Renderer(joined(model, broken), device, energy=energy, style=style)
    for product in ("image", "depth", "contributions"):
        assert_same_bits([getattr(alone, product)(view)], [getattr(among, product)(view)])


def test_the_storage_order_does_not_matter(device, style, energy, monkeypatch):
    model, view = blobs(257, 7), tilted_camera()
    sorted_along_the_curve = Renderer(model, device, energy=energy, style=style)
    monkeypatch.setattr("gspure.opencl.storage.FEW", 257)
    as_in_the_file = Renderer(model, device, energy=energy, style=style)
    assert np.array_equal(as_in_the_file._storage.order, np.arange(257))
    assert not np.array_equal(sorted_along_the_curve._storage.order, np.arange(257))
    assert_same_bits(everything(as_in_the_file, view), everything(sorted_along_the_curve, view))


def test_bands_give_the_same_bits(device, style, energy):
    model, view = blobs(257, 8), tilted_camera(65, 97)
    whole = everything(Renderer(model, device, energy=energy, style=style), view)
    for budget in (1, 600):
        banded = Renderer(model, device, energy=energy, style=style, entry_budget=budget)
        assert_same_bits(everything(banded, view), whole)


def test_earlier_views_leave_no_trace(device, style, energy):
    """Buffers are kept between views of any size and kind."""
    model = blobs(80, 9)
    small, large = tilted_camera(17, 15), camera(65, 47)
    used = Renderer(model, device, energy=energy, style=style)
    for view in (large, small, large):
        assert_same_bits(everything(used, view), everything(Renderer(model, device, energy=energy, style=style), view))


def test_threads_that_share_a_renderer_get_the_same_bits(device, style):
    renderer = Renderer(blobs(300, 5), device, style=style)
    views = [tilted_camera(48 + i, 33) for i in range(20)]
    alone = [renderer.image(view) for view in views]
    with ThreadPoolExecutor(2) as pool:
        assert_same_bits(alone, pool.map(renderer.image, views))


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
@pytest.mark.parametrize("use", [lambda renderer: renderer.depth(camera(8, 8)), lambda _: Renderer(blobs(1))])
def test_a_forked_process_is_refused_instead_of_waiting_forever(device, use):
    renderer = Renderer(blobs(1), device)
    child = os.fork()
    if not child:
        signal.alarm(20)
        try:
            use(renderer)
        except InputError as error:
            os._exit("fork" not in str(copy(error)))  # as a pool of processes does
        finally:
            os._exit(1)
    assert os.waitpid(child, 0)[1] == 0


def test_a_device_is_chosen_only_where_none_is_named(device, monkeypatch):
    monkeypatch.setattr("gspure.renderer.choose_device", lambda: None)
    assert Renderer(blobs(1), device)._engine.device == device.cl_device
    with pytest.raises(AttributeError):
        Renderer(blobs(1))


def test_an_image_needs_colours(device):
    table = blobs(3).table
    bare = table[[name for name in table.dtype.names if not name.startswith("f_")]]
    renderer = Renderer(type(blobs(1))(bare), device)
    assert renderer.transmittance(camera(8, 8)).shape == (8, 8)
    with pytest.raises(InputError, match="f_dc_0"):
        renderer.image(camera(8, 8))


@pytest.mark.parametrize(("rows", "background"), [(2, None), (4, None), (3, [0.0, 0.0])])
def test_features_of_another_shape_are_refused(device, rows, background):
    renderer = Renderer(blobs(3), device)
    with pytest.raises(ValueError, match=r"features|background"):
        renderer.feature_map(camera(8, 8), np.ones((rows, 5), np.float32), background)


def test_an_unknown_energy_is_refused(device):
    with pytest.raises(ValueError, match="'typo'"):
        Renderer(blobs(1), device, energy="typo")


def test_an_image_too_large_for_the_device_is_refused(device, style):
    huge = camera(focal=100.0)
    for side in ("width", "height"):
        object.__setattr__(huge, side, 200_000)  # more than a camera may have
    with pytest.raises(InputError, match=r"memory: expected room for \d+ GiB in one piece"):
        Renderer(blobs(3), device, style=style).image(huge)
