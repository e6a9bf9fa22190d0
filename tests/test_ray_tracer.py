"""The ray tracer: geometry against analysis, light against closed forms, and determinism."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gspure.scenes import lighting, photography
from gspure.scenes.lighting import Lamp, Scene, bake, first_hits
from gspure.scenes.photography import path_cameras, trace
from gspure.scenes.procedural import scene_builder
from gspure.scenes.rooms import PLACEMENTS
from gspure.scenes.solids import Box, Room, Sphere, plain, reflectance
from tests.models import camera

NAMES = ["room", "vault", "interior-1", "landscape-1", "object-1"]
GREY = (plain("#808080"),)
DARK = Lamp((0.0, 0.0, 100.0), 1.0, (0.0, 0.0, 0.0))
SOLIDS = {
    "box": Box((0.3, -0.2, 1.0), (1.0, 2.0, 0.5), GREY),
    "turned box": Box((0.3, -0.2, 1.0), (1.0, 2.0, 0.5), GREY, yaw=0.7),
    "room": Room((0.0, 0.0, 1.5), (6.0, 5.0, 3.0), GREY),
    "sphere": Sphere((0.4, 1.0, -0.5), 0.7, GREY),
}


@pytest.fixture
def coarse(monkeypatch):
    """Light maps that are quick to bake."""
    monkeypatch.setattr(lighting, "NODE_SPACING", 0.5)
    monkeypatch.setattr(lighting, "DIRECTIONS", 4)
    monkeypatch.setattr(lighting, "LAMP_SAMPLES", 2)


def lit(*solids, sky=(1.0, 1.0, 1.0)):
    return bake(Scene(solids, DARK, sky))


@pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS.keys())
@settings(max_examples=30, deadline=None)
@given(u=st.floats(0.01, 0.99), v=st.floats(0.01, 0.99), away=st.floats(0.01, 0.3), slant=st.floats(-0.3, 0.3))
def test_a_ray_back_to_a_place_of_a_face_hits_it_there(solid, u, v, away, slant):
    for face in solid.faces:
        points, normals = solid.chart(face, np.array([[u, v]]))
        origins = points + away * (normals + slant * np.roll(normals, 1, axis=1))
        directions = points - origins
        distance = solid.distance(origins, directions)
        assert distance == pytest.approx(1.0, abs=1e-7)
        faces, uv = solid.locate(origins + distance[:, None] * directions)
        assert faces == face
        assert uv == pytest.approx(np.array([[u, v]]), abs=1e-7)
        assert (normals**2).sum() == pytest.approx(1.0)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("spread", [0.0, 0.3, 3.0])
def test_first_hits_are_the_nearest_of_all_solids(name, spread):
    scene = scene_builder(name)(PLACEMENTS["coincident"])
    rng = np.random.default_rng(0)
    beams = rng.normal(size=(2, 200, 3)).repeat(20, axis=1)
    origins, directions = beams + spread * rng.normal(size=beams.shape)
    distances, hit = first_hits(scene, origins, directions)
    alone = np.array([solid.distance(origins, directions) for solid in scene.solids])
    assert distances.tobytes() == alone.min(axis=0).tobytes()
    assert np.array_equal(hit, np.where(np.isinf(distances), -1, alone.argmin(axis=0)))


def test_depth_of_a_sphere_is_the_analytic_one_along_rays_through_pixel_centres(coarse):
    view = camera(33, 21, focal=25.0, principal=(15.2, 11.7))
    _, depth = trace(lit(Sphere((0.1, -0.2, 4.0), 1.0, GREY)), view)
    x = (np.arange(33) + 0.5 - 15.2) / 25.0
    y = (np.arange(21)[:, None] + 0.5 - 11.7) / 25.0
    a = x**2 + y**2 + 1.0
    b = 0.1 * x - 0.2 * y + 4.0
    discriminant = b**2 - a * (0.1**2 + 0.2**2 + 16.0 - 1.0)
    with np.errstate(invalid="ignore"):
        expected = np.where(discriminant > 0.0, (b - np.sqrt(discriminant)) / a, np.inf)
    np.testing.assert_allclose(depth, expected, rtol=1e-6)


def test_an_open_floor_gathers_exactly_the_sky():
    scene = lit(Box((0.0, 0.0, -0.5), (4.0, 4.0, 1.0), GREY), sky=(0.6, 0.6, 0.6))
    places = np.array([[0.1, 0.9], [0.5, 0.5]])
    assert scene.radiance(0, np.array([5, 5]), places)[:, 0] == pytest.approx(0.6 * reflectance("#808080")[0])


@pytest.mark.parametrize("name", NAMES)
def test_photographs_are_the_same_bits_for_any_batch_of_rays(coarse, monkeypatch, name):
    scene = scene_builder(name)(PLACEMENTS["raised"])
    view = path_cameras(3, 40, 30)[1]
    image, depth = trace(bake(scene), view)
    monkeypatch.setattr(photography, "_RAYS_AT_ONCE", 77)
    monkeypatch.setattr(lighting, "_RAYS_AT_ONCE", 101)
    again = trace(bake(scene), view)
    assert (image.tobytes(), depth.tobytes()) == tuple(part.tobytes() for part in again)
    assert 0.05 < image.mean() < 0.95
