"""Whether views and a model share a world: tests with a capture's points, with its photographs, and with the views.

A test scores similarities from the world of the views to that of the model. It supports one whose score is higher than
those of the model turned or scaled a lot, and contradicts one whose score rises when the model is turned, scaled or
shifted a little: so no test needs a limit of its own for what is similar enough. To be fast, random points stand for
the model's Gaussians, and images are thumbnails. All limits are ours, from models of five captures in correct and wrong
worlds.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Final

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
_SIDE: Final = 48  # side of a thumbnail, in pixels

_FEWEST_POINTS: Final = 30  # for a test
_MOST_POINTS: Final = 1000
_PRESENT: Final = 0.25  # share of the capture's points that a model must have: users cut objects out
WHOLE: Final = 20  # least score of points that the model has not lost
_FARTHEST: Final = 0.2  # larger distances, relative to the extent of the points, count as this
_FEWEST_PHOTOGRAPHS: Final = 3  # for a test
_RECOGNIZED: Final = 0.75  # least share of thumbnails that are most like their own photograph
_EXACT: Final = 1e-6  # smaller distances count as this
_GAIN: Final = 2.0  # the least ratio of scores for which views are moved
_DISTINCT: Final = 1.2  # a fit scores at least this many times as much as after any large change
_BETTER: Final = 1.1  # nor is it one if a small change makes it score this many times as much
_LARGE: Final = ((20.0, 1.25, 0.1),)  # changes: degrees, factor, and share of the extent
_SMALL: Final = ((10.0, 1.1, 0.05), (4.0, 1.04, 0.02))

Score = Callable[[Float64], float]
"""From a similarity [4,4] to how well the model fits the capture moved by it, above 0."""


def best_world(score: Score, worlds: Mapping[str, Float64]) -> str:
    """Return the name of the similarity that fits best, "" for the identity unless another fits clearly better."""
    scores = {name: score(world) for name, world in worlds.items()}
    best = max(scores, key=lambda name: scores[name])
    return best if scores[best] > _GAIN * scores[""] else ""


def supports(score: Score, world: Float64, cloud: "Cloud") -> bool:
    """Return whether all large changes of the model lower the score of a similarity [4,4]."""
    highest = max(score(change @ world) for change in cloud.changes(_LARGE))
    return score(world) > _DISTINCT * highest


def contradicts(score: Score, world: Float64, cloud: "Cloud") -> bool:
    """Return whether a similarity [4,4] has no score, or small changes of the model, one after another, raise it."""
    first = highest = score(world)
    for change in cloud.changes(_SMALL):
        changed = score(change @ world)
        if changed > highest:
            highest = changed
            world = change @ world
    return first == 0 or highest > _BETTER * first


def fits(score: Score, world: Float64, cloud: "Cloud") -> bool:
    """Return whether a similarity [4,4] is supported and not contradicted."""
    return supports(score, world, cloud) and not contradicts(score, world, cloud)


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

    def changes(self, sizes: Iterable[tuple[float, float, float]]) -> Iterator[Float64]:
        """Yield similarities [4,4] that turn, scale or shift the model about its middle, of each size in turn."""
        middle = np.median(self.points, axis=0)
        low, high = np.quantile(self.points, (0.1, 0.9), axis=0)
        for degrees, factor, share in sizes:
            for axis in (*np.eye(3), *-np.eye(3)):
                turn = rotation(math.radians(degrees) * axis)
                yield rigid(turn, middle - turn @ middle)
                yield rigid(np.eye(3), share * np.linalg.norm(high - low) * axis)
            for scale in (factor, 1 / factor):
                yield rigid(scale * np.eye(3), (1 - scale) * middle)

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


def share_too_near(points: Float64, cameras: Sequence[Camera]) -> float:
    """Return the largest share of the points [P,3] in a view that lie before its near plane; some stand for all."""
    sample = points[:: _stride(len(points), _POINTS)]
    shares = [0.0]
    for camera in _some(cameras, _VIEWS_SEEN):
        depths = points_shown(camera, sample, near=0.0)[1][:, 2]
        shares.append(np.count_nonzero(depths <= NEAR_PLANE) / max(1, len(depths)))
    return max(shares)


def _some(cameras: Sequence[Camera], most: int) -> Sequence[Camera]:
    return cameras[:: _stride(len(cameras), most)]


def _stride(count: int, most: int) -> int:
    """Return the step with which at most so many of `count` are taken."""
    return max(1, -(-count // most))


def score_by_views(cloud: Cloud, cameras: Sequence[Camera]) -> Score:
    """Return a weak test: the views show much of the model, and it fills much of the views."""

    def score(world: Float64) -> float:
        views = [camera.moved(world) for camera in _some(cameras, _VIEWS_SEEN)]
        return cloud.share_covered(views) * cloud.share_seen(views)

    return score


def score_by_points(cloud: Cloud, xyz: Float64) -> Score | None:
    """Return a test: do the points [P,3] of the capture lie near Gaussians? None if there are few points."""
    from scipy.spatial import KDTree

    if min(len(xyz), len(cloud.points)) < _FEWEST_POINTS:
        return None
    tree = KDTree(cloud.points)
    sample = xyz[np.random.default_rng(0).permutation(len(xyz))[:_MOST_POINTS]]

    def score(world: Float64) -> float:
        points = sample @ world[:3, :3].T + world[:3, 3]
        low, high = np.quantile(points, (0.1, 0.9), axis=0)
        extent = max(np.linalg.norm(high - low), np.finfo(np.float32).tiny)
        distances, _ = tree.query(points, distance_upper_bound=_FARTHEST * extent)
        distance = np.quantile(np.minimum(distances, _FARTHEST * extent), _PRESENT) / extent
        return float(1 / max(distance, _EXACT))

    return score


def score_by_photographs(cloud: Cloud, cameras: Sequence[Camera]) -> Score | None:
    """Return a test: are thumbnails like the photographs of their views? None if there are few, or no colours.

    The score is the square of the mean correlation; 0 unless most thumbnails are more like their own photograph than
    like any other.
    """
    colours = cloud.colours
    views = []
    images = []
    for camera in _some([camera for camera in cameras if camera.image and camera.image.is_file()], _VIEWS):
        with suppress(InputError):  # whoever needs the photograph refuses it
            images.append(read_image(photograph(camera), (_SIDE, _SIDE), cloud.background))
            views.append(camera)
    if colours is None or len(colours) == 0 or len(views) < _FEWEST_PHOTOGRAPHS:
        return None

    def score(world: Float64) -> float:
        correlations = np.zeros((len(views), len(views)))
        for row, camera in enumerate(views):
            nearest = cloud.nearest(camera.moved(world))
            is_shown = nearest >= 0
            if is_shown.any():
                drawn = colours[nearest[is_shown]]
                correlations[row] = [_correlation(drawn, image[is_shown]) for image in images]
        others = np.where(np.eye(len(views)), -np.inf, correlations).max(axis=1)
        is_recognized = np.diag(correlations) > others
        mean = max(float(np.diag(correlations).mean()), 0.0)
        return mean**2 if is_recognized.mean() >= _RECOGNIZED else 0.0

    return score


def _correlation(a: Float32, b: Float32) -> float:
    """Return the correlation of colours [N,3], without their means; 0 if either does not vary."""
    a = a - a.mean(axis=0)
    b = b - b.mean(axis=0)
    norm = np.sqrt((a * a).sum() * (b * b).sum())
    return float((a * b).sum() / norm) if norm > 0 else 0.0
