from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from gspure.cameras import Camera, intrinsics, scaled
from gspure.errors import InputError
from tests.camera_cases import cameras, project


def view(width, height):
    return Camera("view", width, height, intrinsics(1000, 1010, width / 2, height / 2), np.eye(4))


def size(width, height, rule):
    (camera,) = scaled([view(width, height)], rule)
    return camera.width, camera.height


def test_native_keeps_the_files_size():
    assert size(5187, 3361, "native") == (5187, 3361)


def test_a_fraction_of_rows_is_rounded_half_to_even():
    assert size(5187, 3361, "1/4") == (1297, 840)
    assert size(989, 743, "1/2") == (494, 372)
    assert size(3, 2, "1/8") == (1, 1)


def test_a_largest_width_also_reduces_the_height():
    assert size(3958, 2968, "1600px") == (1600, 1199)
    assert size(1600, 1199, "1600px") == (1600, 1199)
    assert size(989, 742, "1600px") == (989, 742)
    assert size(9000, 1, "1600px") == (1600, 1)


def test_a_photograph_that_is_a_reduced_copy_gives_the_view_its_size(tmp_path):
    Image.new("RGB", (1237, 822)).save(tmp_path / "reduced.png")
    large = replace(view(4946, 3286), image=tmp_path / "reduced.png")
    (small,) = scaled([large], "photographs")
    assert (small.width, small.height) == (1237, 822)
    assert small.K[0, 0] / small.width == pytest.approx(large.K[0, 0] / large.width)


@given(cameras(), st.sampled_from(["native", "1/2", "1/7", "100px", "1600px"]))
def test_every_point_keeps_its_place_in_the_picture(camera, rule):
    (small,) = scaled([camera], rule)
    point = camera.centre + camera.viewmat[:3, :3].T @ [0.3, -0.2, 1.0]
    before, after = (project(c, point[None])[0][0] for c in (camera, small))
    assert after / [small.width, small.height] == pytest.approx(before / [camera.width, camera.height], rel=1e-6)


@pytest.mark.parametrize("rule", ["", "0", "4", "1/0", "1/-2", "1/2.5", "0px", "1600", "1600 px", "2/3", "native "])
def test_any_other_rule_is_refused(rule):
    with pytest.raises(InputError, match="expected native, photographs, 1/N or Wpx"):
        scaled([view(4, 3)], rule)


def test_a_size_is_a_whole_number_also_of_numpy() -> None:
    camera = replace(view(4, 3), width=np.int64(40), height=np.uint16(30))
    assert (type(camera.width), type(camera.height)) == (int, int)
    for size in (40.0, 40.5, "40", 0, -40):
        with pytest.raises(InputError, match="width: expected a whole number"):
            replace(view(4, 3), width=size)


@pytest.mark.parametrize(
    "K",
    [np.zeros((3, 3)), intrinsics(-9, 9, 2, 2), 2 * intrinsics(9, 9, 2, 2), np.triu(np.full((3, 3), 9.0)), np.eye(4)],
)
def test_intrinsics_that_are_not_those_of_a_pinhole_are_refused(K) -> None:
    with pytest.raises(InputError, match="view: K: expected fx 0 cx"):
        replace(view(4, 3), K=K)


@pytest.mark.parametrize("viewmat", [np.diag([2.0, 2, 2, 1]), np.diag([-1.0, 1, 1, 1]), np.diag([1.0, 1, 1, 2])])
def test_a_view_that_is_not_rigid_is_refused(viewmat) -> None:
    with pytest.raises(InputError, match="view: viewmat: expected"):
        replace(view(4, 3), viewmat=viewmat)
