"""The synthetic room, the scene of the benchmarks of the renderer, with the tails of a trained indoor model.

At 960x540, 57 of 100 thousand Gaussians are visible and 0.40 M tile entries result; at 1600x1063, 574 thousand of a
million and 2.1 M.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pytest
from numpy.typing import NDArray

from gspure.cameras.camera import Camera, intrinsics
from gspure.model import Gaussians

Float64 = NDArray[np.float64]

BLOBS = 60
GROUND_AREA = 26.0 * 26.0
WALLS_AREA = 2.0 * 26.0 * 8.0
FLATNESS = np.array([1.0, 1.0, 0.35])  # factors of a Gaussian's three scales
BACKGROUND_SHARE = 0.1
COVERAGE = 0.42  # median scale of a Gaussian, relative to the side of the square of its share of the area
FIELD_OF_VIEW = np.radians(62.0)


def camera(width: int, height: int) -> Camera:
    """Return the view from the origin along z."""
    focal = 0.5 * width / np.tan(0.5 * FIELD_OF_VIEW)
    return Camera("room", width, height, intrinsics(focal, focal, width / 2, height / 2), np.eye(4))


def panning(views: int, width: int, height: int) -> list[Camera]:
    """Return views from the origin that turn by 60 degrees about the vertical."""
    cameras = []
    for i, angle in enumerate(np.radians(np.linspace(-30.0, 30.0, views))):
        viewmat = np.eye(4)
        viewmat[::2, ::2] = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
        cameras.append(replace(camera(width, height), name=f"view_{i:03d}", viewmat=viewmat))
    return cameras


def room(count: int, seed: int = 14) -> Gaussians:
    """Return `count` Gaussians on blobs, the ground and two walls, a tenth of them far behind; y points down."""
    rng = np.random.default_rng(seed)
    radii = np.exp(rng.normal(-0.3, 0.5, BLOBS))
    areas = np.array([*(4 * np.pi * radii**2), GROUND_AREA, WALLS_AREA])
    surfaces = rng.choice(len(areas), count, p=areas / areas.sum())
    means = _on_surfaces(rng, surfaces, radii)
    background = rng.random(count) < BACKGROUND_SHARE
    means[background] = _far_behind(rng, int(background.sum()))

    sizes = COVERAGE * np.sqrt(areas.sum() / count) * rng.lognormal(0.0, 0.75, (count, 1))
    scales = sizes * rng.lognormal(0.0, 0.45, (count, 3)) * FLATNESS
    scales[background] *= 3.0
    sh_coeffs = rng.standard_normal((count, 16, 3), np.float32) * np.float32(0.12)
    sh_coeffs[:, 0] = rng.normal(0.0, 0.9, (len(areas), 3))[surfaces] + rng.normal(0.0, 0.315, (count, 3))
    return Gaussians.from_parameters(
        means=means,
        quats=rng.normal(size=(count, 4)),
        scales=scales,
        opacities=1.0 / (1.0 + np.exp(-rng.normal(0.2, 2.0, count))),
        sh_coeffs=sh_coeffs,
    )


def _on_surfaces(rng: np.random.Generator, surfaces: NDArray[np.intp], radii: Float64) -> Float64:
    """Return a point near each of the given surfaces: blob 0 to BLOBS - 1, ground, or one of the walls."""
    count = len(surfaces)
    centres = rng.uniform((-7.0, -2.0, 4.0), (7.0, 2.2, 22.0), (BLOBS, 3))
    blobs = np.minimum(surfaces, BLOBS - 1)
    distances = radii[blobs] * rng.normal(1.0, 0.03, count)
    on_blobs = centres[blobs] + distances[:, None] * _unit(rng.normal(size=(count, 3)))
    depths = rng.uniform(0.3, 26.0, count)
    on_ground = np.column_stack([rng.uniform(-13.0, 13.0, count), rng.normal(2.4, 0.05, count), depths])
    sides = np.where(rng.random(count) < 0.5, -12.5, 12.5)
    on_walls = np.column_stack([sides + rng.normal(0.0, 0.1, count), rng.uniform(-6.0, 2.4, count), depths])
    kinds = np.maximum(surfaces - (BLOBS - 1), 0)
    return np.choose(kinds[:, None], [on_blobs, on_ground, on_walls])


def _far_behind(rng: np.random.Generator, count: int) -> Float64:
    points = rng.normal(size=(count, 3))
    points[:, 2] = np.abs(points[:, 2]) + 0.5
    return _unit(points) * rng.uniform(26.0, 60.0, (count, 1))


def _unit(vectors: Float64) -> Float64:
    lengths: Float64 = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / lengths


@dataclass(frozen=True)
class Scene:
    """A room of `count` Gaussians and the size of its one view, measured `rounds` times.

    Goals: a frame with contributions within `frame_ms` on two cores, blending at `peak_share` of the FMA peak.
    """

    name: str
    count: int
    width: int
    height: int
    rounds: int
    frame_ms: float
    peak_share: float

    @cached_property
    def model(self) -> Gaussians:
        """The Gaussians, drawn once."""
        return room(self.count)

    @property
    def camera(self) -> Camera:
        """The view."""
        return camera(self.width, self.height)


SMALL = Scene("100k @960x540", 100_000, 960, 540, rounds=21, frame_ms=20.0, peak_share=0.40)
LARGE = Scene("1M @1600x1063", 1_000_000, 1600, 1063, rounds=11, frame_ms=130.0, peak_share=0.33)


each_scene = pytest.mark.parametrize("scene", [SMALL, LARGE], ids=lambda scene: scene.name)
