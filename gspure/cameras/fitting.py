"""Whether views and a model share a world: tests with a capture's points, with its photographs, and with the views.

A test scores similarities [4,4] from the world of the views to that of the model; more is better. To be fast, random
points stand for the model's Gaussians, and images are thumbnails. All limits are ours, from models of five captures in
correct and wrong worlds.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Final, Protocol

import numpy as np

from gspure.arrays import Float32, Float64, Indices
from gspure.cameras.camera import Camera, points_shown, rigid
from gspure.cameras.photographs import photograph
from gspure.constants import NEAR_PLANE, SH_DC
from gspure.errors import InputError
from gspure.images import read_image
from gspure.model.gaussians import Gaussians
from gspure.model.rotations import principal_axes, rotation

_POINTS: Final = 20_000  # number of random points of a model
_VISIBLE: Final = 1 / 255  # opacity of a row that is seen
_VIEWS: Final = 8  # largest number of views that are drawn, and
_VIEWS_SEEN: Final = 64  # of those that may see a point
_SIDE: Final = 32  # side of a thumbnail, in pixels

_FEWEST_POINTS: Final = 30  # for a test
_MOST_POINTS: Final = 2000
_PRESENT: Final = 0.25  # share of the capture's points that a model must have: users cut objects out
_NEAR: Final = 0.5  # largest distance of points from a model that they fit, relative to wrong worlds
_FEWEST_PHOTOGRAPHS: Final = 3  # for a test
_RECOGNIZED: Final = 0.75  # least share of thumbnails that are most like their own photograph


class FitTest(Protocol):
    """A way to score similarities; another one than the identity must score `gain` times as much."""

    gain: float

    def score(self, world: Float64) -> float:
        """Return how well the model fits the capture moved by `world`."""
        ...

    def accepts(self, world: Float64) -> bool:
        """Return whether it fits at all."""
        ...


def best_world(test: FitTest, worlds: Mapping[str, Float64]) -> str | None:
    """Return the name of the similarity that fits best, "" for the identity; None if the test accepts none."""
    scores = {name: test.score(world) for name, world in worlds.items()}
    best = max(scores, key=lambda name: scores[name])
    if scores[best] < test.gain * scores[""]:
        best = ""
    return best if test.accepts(worlds[best]) else None


class Cloud:
    """Random points [S,3] of a model's visible Gaussians, more of the opaque ones, and their colours, if any."""

    def __init__(self, model: Gaussians) -> None:
        rng = np.random.default_rng(0)
        opacities = np.where(model.opacities > _VISIBLE, model.opacities, 0)
        shares = np.cumsum(opacities, dtype=np.float64)
        count = _POINTS if shares[-1] > 0 else 0
        sample = model[np.searchsorted(shares, shares[-1] * rng.random(count), side="right")]
        with np.errstate(all="ignore"):
            offsets = np.einsum("ki,kij->kj", rng.normal(size=(count, 3)), principal_axes(sample))
            points = sample.means + offsets
        is_finite = np.isfinite(points).all(axis=1)
        self.points: Float64 = points[is_finite]
        has_colours = model.sh_degree >= 0
        self.colours = 0.5 + SH_DC * sample.sh_coeffs_of(0)[is_finite, 0] if has_colours else None
        self.background = model.background

    def nearest(self, camera: Camera) -> Indices:
        """Return the row of the nearest point in each pixel of a thumbnail [H,W]; -1 where there is none."""
        rows, positions = points_shown(camera.resized(_SIDE, _SIDE), self.points)
        order = np.argsort(-positions[:, 2])
        columns, lines = positions[order, :2].astype(int).T
        image = np.full((_SIDE, _SIDE), -1)
        image[lines, columns] = rows[order]  # the last one counts
        return image

    def share_covered(self, cameras: Sequence[Camera]) -> float:
        """Return the share of the views' pixels that show points."""
        return float(np.mean([self.nearest(camera) >= 0 for camera in _some(cameras, _VIEWS)]))

    def share_seen(self, cameras: Sequence[Camera]) -> float:
        """Return the share of the points that any view shows."""
        is_seen = np.zeros(len(self.points), bool)
        for camera in _some(cameras, _VIEWS_SEEN):
            is_seen[points_shown(camera, self.points)[0]] = True
        return float(is_seen.sum() / max(1, len(is_seen)))

    def share_too_near(self, cameras: Sequence[Camera]) -> float:
        """Return the largest share of the points in a view that lie before its near plane."""
        shares = [0.0]
        for camera in _some(cameras, _VIEWS_SEEN):
            depths = points_shown(camera, self.points, near=0.0)[1][:, 2]
            shares.append(np.count_nonzero(depths <= NEAR_PLANE) / max(1, len(depths)))
        return max(shares)


def _some(cameras: Sequence[Camera], most: int) -> Sequence[Camera]:
    return cameras[:: max(1, -(-len(cameras) // most))]


class ViewsTest:
    """The views show much of the model, and the model fills much of the views: weak evidence, never a refusal."""

    gain = 1.5

    def __init__(self, cloud: Cloud, cameras: Sequence[Camera]) -> None:
        self._cloud = cloud
        self._cameras = _some(cameras, _VIEWS_SEEN)

    def score(self, world: Float64) -> float:
        """Return the share of covered pixels times the share of seen points."""
        views = [camera.moved(world) for camera in self._cameras]
        return self._cloud.share_covered(views) * self._cloud.share_seen(views)

    def accepts(self, world: Float64) -> bool:  # noqa: ARG002
        """Return True: a few views of a part of a model are no fault."""
        return True


class PointsTest:
    """The points of a capture lie near Gaussians of the model."""

    gain = 2.0

    def __init__(self, cloud: Cloud, xyz: Float64) -> None:
        from scipy.spatial import KDTree

        self._tree = KDTree(cloud.points)
        self._xyz = xyz[np.random.default_rng(0).permutation(len(xyz))[:_MOST_POINTS]]
        centre = np.median(self._xyz, axis=0)
        turns = [rotation(np.radians(vector)) for vector in ((90, 0, 0), (0, 90, 0), (0, 0, 90), (25, 25, 25))]
        changes = [*turns, 2 * np.eye(3), np.eye(3) / 2]
        self._wrong = [rigid(change, centre - change @ centre) for change in changes]

    @staticmethod
    def applies(cloud: Cloud, xyz: Float64) -> bool:
        """Return whether there are enough points."""
        return min(len(xyz), len(cloud.points)) >= _FEWEST_POINTS

    def score(self, world: Float64) -> float:
        """Return the inverse of the distance from the model below which a quarter of the points lie, per extent."""
        return float(1 / max(self._distance(world), np.finfo(np.float32).eps))

    def accepts(self, world: Float64) -> bool:
        """Return whether points that are turned or scaled are much farther from the model."""
        return self._distance(world) < _NEAR * np.median([self._distance(world @ wrong) for wrong in self._wrong])

    def _distance(self, world: Float64) -> float:
        points = self._xyz @ world[:3, :3].T + world[:3, 3]
        low, high = np.quantile(points, (0.1, 0.9), axis=0)
        distances, _ = self._tree.query(points)
        return float(np.quantile(distances, _PRESENT) / max(np.linalg.norm(high - low), np.finfo(np.float32).tiny))


class PhotographsTest:
    """Thumbnails of the model look like the photographs of their views."""

    gain = 1.3

    def __init__(self, cloud: Cloud, cameras: Sequence[Camera]) -> None:
        self._cloud = cloud
        self._cameras: list[Camera] = []
        self._images: list[Float32] = []
        for camera in _some([camera for camera in cameras if camera.image and camera.image.is_file()], _VIEWS):
            with suppress(InputError):  # whoever needs the photograph refuses it
                self._images.append(read_image(photograph(camera), (_SIDE, _SIDE), cloud.background))
                self._cameras.append(camera)

    @property
    def applies(self) -> bool:
        """Whether there are colours, and enough photographs."""
        return self._cloud.colours is not None and len(self._images) >= _FEWEST_PHOTOGRAPHS

    def score(self, world: Float64) -> float:
        """Return the mean correlation of a thumbnail with its photograph, above zero."""
        return max(float(np.mean(np.diag(self._correlations(world)))), 0.01)

    def accepts(self, world: Float64) -> bool:
        """Return whether most thumbnails are more like their own photograph than like those of other views."""
        correlations = self._correlations(world)
        others = np.where(np.eye(len(correlations)), -np.inf, correlations).max(axis=1)
        return bool(np.mean(np.diag(correlations) > others) >= _RECOGNIZED)

    def _correlations(self, world: Float64) -> Float64:
        """Return the correlation of each thumbnail with each photograph [N,N], where it shows the model."""
        correlations = np.zeros((len(self._images), len(self._images)))
        for row, camera in enumerate(self._cameras):
            nearest = self._cloud.nearest(camera.moved(world))
            is_shown = nearest >= 0
            if is_shown.any() and self._cloud.colours is not None:
                colours = self._cloud.colours[nearest[is_shown]]
                correlations[row] = [_correlation(colours, image[is_shown]) for image in self._images]
        return correlations


def _correlation(a: Float32, b: Float32) -> float:
    """Return the correlation of colours [N,3], without their means; 0 if either does not vary."""
    a = a - a.mean(axis=0)
    b = b - b.mean(axis=0)
    norm = np.sqrt((a * a).sum() * (b * b).sum())
    return float((a * b).sum() / norm) if norm > 0 else 0.0
