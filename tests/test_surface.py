"""The surface of a model: 3-D filter, tetrahedra, mesh, distances; small models seen from all around."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay
from scipy.spatial.transform import Rotation

from gspure.attacks import Measurements, find_attack
from gspure.cameras.camera import rigid
from gspure.errors import InputError
from gspure.public_model import PublicModel
from gspure.surface.distances import INVISIBLE, depth_distances, mesh_distances
from gspure.surface.meshing import Mesh, extract_mesh, filter_sizes, smoothed
from gspure.surface.tetrahedra import box_points, march
from tests.anchor_cases import random_public
from tests.models import camera, gaussians, joined, tilted_camera
from tests.reference.opacity_field import opacity_field


def directions(count):
    """Points spread evenly over the unit sphere (Fibonacci)."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    return np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)


def ball(count=300, radius=1.0, opacity=0.95):
    """Discs that tile a sphere, flat along its radius."""
    normals = directions(count)
    # (1 + n.z, z x n) turns the z axis onto n
    quats = np.stack([1 + normals[:, 2], -normals[:, 1], normals[:, 0], np.zeros(count)], axis=1)
    side = 1.2 * radius * np.sqrt(4 * np.pi / count) / 2
    return gaussians(means=radius * normals, quats=quats, scales=[side, side, 0.02], opacities=opacity)


@pytest.fixture(scope="module")
def views():
    """Six views of the origin, along the axes."""
    ahead = camera(48, 48, focal=57.6, viewmat=rigid(np.eye(3), np.array([0, 0, 4.0])))
    angles = [(0, 0), (0, 90), (0, 180), (0, 270), (90, 0), (-90, 0)]
    turns = [Rotation.from_euler("xy", pair, degrees=True).as_matrix() for pair in angles]
    return [replace(ahead.moved(rigid(turn, np.zeros(3))), name=f"view_{i}") for i, turn in enumerate(turns)]


def test_views_see_a_margin_beyond_their_edges_and_what_none_sees_gets_the_largest_filter():
    view = camera(40, 40, focal=20.0)
    edge = 2 * (1 + 2 * 0.15)  # of x at z = 2, widened
    model = gaussians(means=[[0.99 * edge, 0, 2], [1.01 * edge, 0, 2], [0, 0, -1], [0, 0, 1]], scales=0.1)
    sizes = filter_sizes(model, [view]) * 20 / np.sqrt(0.2)  # in view depths of the nearest view
    np.testing.assert_allclose(sizes, [2, 2, 2, 1], rtol=1e-6)
    with_a_finer_view = filter_sizes(model, [view, camera(40, 40, focal=60.0)]) * 60 / np.sqrt(0.2)
    np.testing.assert_allclose(with_a_finer_view, [2, 2, 2, 1], rtol=1e-6)


def test_filtered_gaussians_are_wider_and_as_opaque(views):
    model = ball(50)
    after, sizes = smoothed(model, views), filter_sizes(model, views)
    np.testing.assert_allclose(after.scales, np.hypot(model.scales, sizes[:, None]), rtol=1e-6)
    kept = [name for name in model.table.dtype.names if not name.startswith("scale_")]
    assert after.table[kept].tolist() == model.table[kept].tolist()


def test_a_gaussian_lies_in_a_box_of_three_deviations():
    model = gaussians(means=[1, 2, 3], scales=[0.1, 0.2, 0.3], quats=[1, 0, 0, 1])  # a quarter turn about z
    points = box_points(model)
    np.testing.assert_allclose(points[-1], [1, 2, 3])
    np.testing.assert_allclose(points[:8].min(axis=0), [0.4, 1.7, 2.1], rtol=1e-6)
    np.testing.assert_allclose(points[:8].max(axis=0), [1.6, 2.3, 3.9], rtol=1e-6)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**31), turned=st.booleans())
def test_marching_separates_inside_from_outside_by_closed_oriented_surfaces(seed, turned):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(60, 3))
    cells = Delaunay(points).simplices.astype(np.intp)
    if turned:
        cells = cells[:, [1, 0, 2, 3]]
    hull = np.unique(Delaunay(points).convex_hull)
    inside = rng.random(60) < 0.5
    inside[hull] = False
    edges, faces = march(points, cells, inside)
    assert inside[edges[:, 0]].all()
    assert not inside[edges[:, 1]].any()
    assert (np.bincount(faces.ravel(), minlength=len(edges)) > 0).all()
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    assert len(np.unique(sides, axis=0)) == len(sides), "no side twice in one direction"
    assert {*map(tuple, sides)} == {*map(tuple, sides[:, ::-1])}, "every side once in each: closed, oriented"
    # The flux of x / 3 through an outward surface is the volume inside: for vertices at the middle of their edges, of
    # a tetrahedron 1/8 at a lone corner, 1/2 between two and two.
    a, b, c = points[edges].mean(axis=1)[faces].transpose(1, 0, 2)
    flux = np.einsum("fi,fi->", a, np.cross(b, c)) / 6
    x, y, z, w = points[cells].transpose(1, 0, 2)
    volumes = np.abs(np.einsum("ti,ti->t", np.cross(y - x, z - x), w - x)) / 6
    shares = np.array([0, 1 / 8, 1 / 2, 7 / 8, 1])[inside[cells].sum(axis=1)]
    np.testing.assert_allclose(flux, (shares * volumes).sum(), rtol=1e-9, atol=1e-12)


def test_vertices_lie_where_the_field_is_one_half(views):
    model = gaussians(means=[[0, 0, 0], [0.2, 0.1, 0.3]], scales=[[0.2, 0.3, 0.25], [0.2, 0.2, 0.2]], opacities=0.8)
    found = extract_mesh(model, views)
    np.testing.assert_allclose(opacity_field(model, views, found.vertices), 0.5, atol=0.02)


@pytest.mark.parametrize(
    ("model", "line"),
    [
        (ball(20, opacity=0.05), "an opacity above 0.1 in the views, found 0 points"),
        (ball(20, opacity=0.2), "both sides of 0.5, found only lower ones"),
    ],
)
def test_a_model_without_a_surface_is_refused(model, line, views):
    with pytest.raises(InputError, match=line):
        extract_mesh(model, views)


def test_distances_are_in_units_of_the_largest_scale():
    mesh = Mesh(np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    model = gaussians(means=[[-1, -1, 0.5], [1, -1, 3]], scales=[[0.1, 0.5, 0.2], [1.5, 0.1, 0.1]])
    np.testing.assert_allclose(mesh_distances(model, mesh), [1, 2], rtol=1e-6)


@pytest.mark.parametrize("method", ["mesh", "depth"])
def test_the_surface_is_kept_and_what_hides_or_floats_is_dropped(method, views):
    # A ball; a layer hidden in it; a floater in its middle; faint floaters around it.
    faint = gaussians(means=1.7 * directions(12), scales=0.05, opacities=0.3)
    parts = [ball(), ball(80, radius=0.6), gaussians(means=[0, 0, 0], scales=0.05, opacities=0.9), faint]
    model, part = joined(*parts), np.repeat(np.arange(4), [len(part) for part in parts])
    wider = smoothed(model, views)
    if method == "mesh":
        distances = mesh_distances(wider, extract_mesh(wider, views))
    else:
        distances = depth_distances(PublicModel(model), views)
    kept = ~find_attack("gof").apply(model, Measurements(surface=distances)).prune_mask
    shares = [kept[part == i].mean() for i in range(4)]
    assert shares[0] > 0.97
    assert shares[1:] == [0, 0, 0]


def test_an_anchor_is_as_near_as_the_nearest_of_its_gaussians():
    public, cameras = random_public(), [camera(), tilted_camera()]
    distances = depth_distances(public, cameras)
    assert distances.shape == (len(public.model),)
    nearest = np.full(len(public.model), INVISIBLE)
    for view in cameras:
        gaussians_, rows = public.gaussians(view)
        np.minimum.at(nearest, rows, depth_distances(PublicModel(gaussians_), [view]))
    np.testing.assert_array_equal(distances, nearest)
    assert 0 < (distances < 3).sum() < len(distances)
