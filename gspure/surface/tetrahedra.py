"""Tetrahedra between points around Gaussians (Yu et al. 2024, Gaussian Opacity Fields), and the surface in them."""

from collections.abc import Sequence
from itertools import combinations, permutations, product
from typing import Final

import numpy as np

from gspure.arrays import Bools, Float32, Float64, Indices
from gspure.cameras import Camera
from gspure.cameras.camera import points_shown
from gspure.model import Gaussians
from gspure.model.rotations import principal_axes

REACH: Final = 3.0  # half side of the box around a Gaussian, in standard deviations (GOF)

_BOX: Final = REACH * np.array([*product((-1.0, 1.0), repeat=3), (0.0, 0.0, 0.0)])
_HASH: Final = np.array([0x1E3779B97F4A7C15, 0x3C6EF372FE94F82B, 0x2545F4914F6CDD1D])  # odd: one number per cell


def box_points(model: Gaussians) -> Float64:
    """Return the corners of the box around each Gaussian, and its centre: 9K rows."""
    return np.asarray(_BOX @ principal_axes(model) + model.means[:, None]).reshape(-1, 3)


def spaced(points: Float64, sizes: Float32 | Float64) -> Bools:
    """Return the mask [P] of one of the `points` [P,3] per cell of a grid, spaced by a power of two.

    It is the power below the size of the point; `sizes` [P] are in world units.
    """
    levels = np.frexp(sizes)[1] - 1
    mask = np.arange(len(points)) < len(_BOX)  # one box: points in a plane have no tetrahedra
    for level in np.unique(levels):  # from fine to coarse
        rows = np.concatenate([np.flatnonzero(mask), np.flatnonzero(levels == level)])
        cells = np.floor(np.ldexp(points[rows], -level)).astype(np.int64) @ _HASH
        _, first_in_cell = np.unique(cells, return_index=True)
        mask[rows[first_in_cell]] = True
    return mask


def shown(points: Float64, cameras: Sequence[Camera]) -> Bools:
    """Return the mask of the `points` [P,3] that any view shows."""
    mask = np.zeros(len(points), np.bool_)
    for camera in cameras:
        rest = np.flatnonzero(~mask)
        rows, _ = points_shown(camera, points[rest])
        mask[rest[rows]] = True
    return mask


def tetrahedra(points: Float64) -> Indices:
    """Return the Delaunay tetrahedra [T,4] of the `points` [P,3], at least four, not all in a plane."""
    from scipy.spatial import Delaunay

    options = "Qbb Qc Qz Q12 Q5"  # scipy's, and Q5: no correction of outer planes, which no tetrahedron uses
    return np.asarray(Delaunay(points, qhull_options=options).simplices, np.intp)


Triangle = tuple[tuple[int, int], tuple[int, int], tuple[int, int]]  # three crossed edges, each by its two corners


def _triangles(case: int) -> list[Triangle]:
    """Return the triangles in a tetrahedron of positive volume whose corner i is inside if bit i of `case` is set.

    They are anticlockwise as seen from outside.
    """
    even = [corners for corners in permutations(range(4)) if _is_even(corners)]
    inside = [i for i in range(4) if case >> i & 1]
    if len(inside) == 2:
        a, b, c, d = next(corners for corners in even if sorted(corners[:2]) == inside)
        return [((a, c), (a, d), (b, d)), ((a, c), (b, d), (b, c))]
    if len(inside) == 1:
        a, b, c, d = next(corners for corners in even if corners[0] in inside)
        return [((a, b), (a, c), (a, d))]
    a, b, c, d = next(corners for corners in even if corners[0] not in inside)
    return [((a, b), (a, d), (a, c))]


def _is_even(permutation: tuple[int, ...]) -> bool:
    inversions = [(a, b) for a, b in combinations(permutation, 2) if a > b]
    return len(inversions) % 2 == 0


_TRIANGLES: Final = {case: np.array(_triangles(case)) for case in range(1, 15)}


def march(points: Float64, tetrahedra: Indices, inside: Bools) -> tuple[Indices, Indices]:
    """Return the edges [V,2] that the surface crosses, and its triangles [F,3].

    The tetrahedra [T,4], of either orientation, partition a convex region; `inside` [P] is the mask of the points [P,3]
    inside the surface. Edges lead from a point inside to one outside; the mesh has a vertex on each. Faces are
    anticlockwise as seen from outside. Within the region, exactly two faces share an edge.
    """
    cases = inside[tetrahedra] @ (1 << np.arange(4))
    crossed = np.flatnonzero((cases > 0) & (cases < 15))
    cases = cases[crossed]
    tetrahedra = tetrahedra[crossed]
    a, b, c, d = points[tetrahedra].transpose(1, 0, 2)
    inverted = np.einsum("ti,ti->t", np.cross(b - a, c - a), d - a) < 0
    corners = []
    for case, triangles in _TRIANGLES.items():
        of_case = cases == case
        edges = tetrahedra[of_case][:, triangles]
        edges[inverted[of_case]] = edges[inverted[of_case]][:, :, ::-1]
        corners.append(edges.reshape(-1, 3, 2))
    ends = np.concatenate(corners)
    ends = np.where(inside[ends[..., :1]], ends, ends[..., ::-1])
    keys, faces = np.unique(ends @ np.array([len(points), 1]), return_inverse=True)
    return np.stack(np.divmod(keys, len(points)), axis=1), faces.reshape(-1, 3)
