from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from gspure.cameras import Camera, intrinsics, scaled
from tests.camera_cases import cameras, project


def view(width, height):
    return Camera("view", width, height, intrinsics(width, 1.01 * width, width / 2, height / 2), np.eye(4))


@pytest.mark.parametrize(
    ("rule", "stored", "expected"),
    [
        ("native", (5187, 3361), (5187, 3361)),
        ("1/4", (5187, 3361), (1297, 840)),  # a half is rounded to the even number
        ("1/2", (989, 743), (494, 372)),
        ("1/8", (3, 2), (1, 1)),
        ("1600px", (3958, 2968), (1600, 1199)),
        ("1600px", (989, 742), (989, 742)),
        ("1600px", (9000, 1), (1600, 1)),
    ],
)
def test_a_rule_gives_a_view_its_size(rule, stored, expected):
    (camera,) = scaled([view(*stored)], rule)
    assert (camera.width, camera.height) == expected


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
