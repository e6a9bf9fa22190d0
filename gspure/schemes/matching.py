"""Matching of the rows of an attacked model with those of the published one."""

from collections.abc import Callable, Iterator
from functools import wraps
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float64, Indices
from gspure.files import digest
from gspure.model.frames import nearest
from gspure.model.gaussians import ROTATION, SCALES, Gaussians, finite
from gspure.model.rotations import moved
from gspure.model.summary import extent_of
from gspure.public_model import PublicModel
from gspure.scenes.alignment import Similarity

Places = Indices
Model = TypeVar("Model", bound=PublicModel)

NEAR: Final = 1e-6  # least move of a row, as a share of the original's extent: text files are not exact; ours
NEIGHBOURS: Final = 8  # number of nearest rows of the original that a moved row may be; ours

ALIKE: Final = 1e-3
"""Largest product of distance, in median distances between neighbours, and difference of log-scales. Ours.

Noise on centres spares scales, and fine-tuning hardly moves centres; in rows of another training, both differ.
"""

MOST: Final = 0.5  # fewer matches than this share of the rows, of the smaller model, may be chance; ours
LANDMARKS: Final = 100  # number of rows of unusual shape from which a registration is fitted; ours
STEPS: Final = 20  # steps of a registration; ours
MIXED: Final = 0.1  # largest share of the differences of features that a mix leaves unexplained; ours
STILL: Final = Similarity(1.0, np.eye(3), np.zeros(3))  # no motion
REMEMBERED: Final = 8  # number of results


def _remembered(match: Callable[..., Places]) -> Callable[..., Places]:
    """Return a function of arrays that remembers its last results: twins of a model all have its geometry."""
    results: dict[str, Places] = {}

    @wraps(match)
    def remembering(*arrays: NDArray[Any]) -> Places:
        contents = digest(*arrays)
        places = results.get(contents)
        if places is None:
            places = match(*arrays)
            places.setflags(write=False)
            results[contents] = places
            if len(results) > REMEMBERED:
                results.pop(next(iter(results)), None)
        return places

    return remembering


@_remembered
def exact_matches(original: NDArray[Any], means: NDArray[Any]) -> Places:
    """Return the index of each centre [K,3] in `original` [N,3], or -1. A far row does not widen the tolerance."""
    from scipy.spatial import KDTree

    if not len(original):
        return np.full(len(means), -1, np.intp)
    extent = extent_of(original.astype(np.float64))
    distances, places = KDTree(original).query(means)
    return np.where(distances <= NEAR * extent, places, -1)


def registered(public: PublicModel, original: Gaussians) -> PublicModel:
    """Return an attacked model, moved back to the place of the original, with its frames and basis of features.

    All rows may have moved by a similarity, and each may have changed slightly. The model stays as it is if its rows
    match where they are, as stored, or if fewer than `MOST` of them match after each of the motions that are tried.
    """
    from scipy.spatial.transform import Rotation

    motion, matches = _matched(original, public.model)
    if motion is not STILL:
        rotvec = Rotation.from_matrix(motion.rotation).as_rotvec()
        public = public.with_model(moved(public.model, rotvec, motion.translation, motion.scale))
    rows = np.flatnonzero(matches >= 0)
    originals = original[matches[rows]]
    return _unmixed(_reframed(public, rows, originals), rows, originals)


def unmixed(public: Model, reference: Gaussians) -> Model:
    """Return the model with the basis of features of the published rows `reference`, if half of them match."""
    matches = adaptive_matches(reference, public.model)
    rows = np.flatnonzero(matches >= 0)
    return _unmixed(public, rows, reference[matches[rows]])


def _reframed(public: PublicModel, rows: Indices, originals: Gaussians) -> PublicModel:
    """Return the model with the frames of the rows [M] nearest to those of their `originals` [M]."""
    attacked = public.model[rows]
    if not public.columns.get("rotation") or np.array_equal(attacked.quats, originals.quats):
        return public
    columns = {name: public.model.table[name].copy() for name in (*ROTATION, *SCALES)}
    for name, values in nearest(attacked.quats, attacked.log_scales, originals).items():
        columns[name][rows] = values
    return public.with_model(public.model.with_columns(columns))


def _unmixed(public: Model, rows: Indices, originals: Gaussians) -> Model:
    """Return the model with the linear mix of features that gives the rows [M] those of their `originals` [M].

    The model stays as it is if a mix explains little of the differences.
    """
    wanted = public.with_model(originals).features.astype(np.float64)
    features = public.features.astype(np.float64)
    if np.array_equal(features[rows], wanted):
        return public
    unmixing, *_ = np.linalg.lstsq(features[rows], wanted, rcond=None)
    unexplained = np.square(features[rows] @ unmixing - wanted).sum()
    if unexplained > MIXED * np.square(features[rows] - wanted).sum():
        return public
    return public.with_features(features @ unmixing)


def adaptive_matches(original: Gaussians, model: Gaussians, motion: Similarity = STILL) -> Places:
    """Return the index in `original` of each row [K] after `motion`, or -1; no two rows have the same index.

    A row of the model may have changed slightly.
    """
    points = motion.points(model.means.astype(np.float64))
    return _likeliest_matches(original.means, _scales(original), points, _scales(model) + np.log(motion.scale))


@_remembered
def _likeliest_matches(
    original: NDArray[Any], original_scales: NDArray[Any], points: NDArray[Any], scales: NDArray[Any]
) -> Places:
    """Return the index of each point [K,3] in `original` [N,3], or -1, by distances and ascending log-scales."""
    from scipy.spatial import KDTree

    unmatched = np.full(len(points), -1, np.intp)
    if len(original) < 2:
        return unmatched
    tree = KDTree(original)
    spacing = float(np.median(tree.query(original, k=2)[0][:, 1]))
    distances, places = tree.query(points, k=range(1, min(NEIGHBOURS, len(original)) + 1))
    products = distances * np.abs(scales[:, None] - original_scales[places]).max(axis=2)
    likeliest = np.arange(len(points)), products.argmin(axis=1)
    candidates = np.flatnonzero(products[likeliest] <= ALIKE * spacing)
    nearest = candidates[np.argsort(distances[likeliest][candidates], kind="stable")]
    matched, first = np.unique(places[likeliest][nearest], return_index=True)
    if len(matched) < MOST * min(len(original), len(points)):
        return unmatched
    matches = unmatched.copy()
    matches[nearest[first]] = matched
    return matches


def _matched(original: Gaussians, model: Gaussians) -> tuple[Similarity, Places]:
    """Return the first of the motions that are tried after which rows match, and the matches."""
    for motion in _motions(original, model):
        matches = adaptive_matches(original, model, motion)
        if (matches >= 0).any():
            return motion, matches
    return STILL, np.full(len(model), -1, np.intp)


def _motions(original: Gaussians, model: Gaussians) -> Iterator[Similarity]:
    """Yield similarities from the model to the original: none; one fitted to equal scales; one to equal ratios."""
    from scipy.spatial import KDTree

    yield STILL
    if min(len(original), len(model)) < 2:
        return
    original_shapes = _scales(original)
    shapes = _scales(model)
    for _ in range(2):
        distances, places = KDTree(original_shapes).query(shapes, k=2)
        landmarks = np.argsort(distances[:, 0] - distances[:, 1], kind="stable")[:LANDMARKS]
        source = model.means[landmarks].astype(np.float64)
        target = original.means[places[landmarks, 0]].astype(np.float64)
        yield _fitted(source, target)
        original_shapes = np.diff(original_shapes)
        shapes = np.diff(shapes)


def _scales(model: Gaussians) -> NDArray[Any]:
    """Return the log-scales [K,3] of each row, ascending."""
    return np.sort(finite(model.log_scales), axis=1)


def _fitted(source: Float64, target: Float64) -> Similarity:
    """Return the similarity that fits the nearer half of pairs of points best."""
    motion = least_squares(source, target)
    half = -(-len(source) // 2)  # rounded up
    for _ in range(STEPS):
        nearest = np.argsort(np.linalg.norm(motion.points(source) - target, axis=1))[:half]
        motion = least_squares(source[nearest], target[nearest])
    return motion


def least_squares(source: Float64, target: Float64) -> Similarity:
    """Return the similarity with the least squared distances (Umeyama 1991)."""
    source_centre = source.mean(axis=0)
    target_centre = target.mean(axis=0)
    left, strengths, right = np.linalg.svd((target - target_centre).T @ (source - source_centre))
    signs = np.array([1, 1, np.sign(np.linalg.det(left @ right))])
    rotation = (left * signs) @ right
    sums = np.array([strengths @ signs, np.square(source - source_centre).sum()])
    numerator, denominator = np.maximum(sums, np.finfo(np.float64).tiny)
    scale = float(numerator) / float(denominator)
    return Similarity(scale, rotation, target_centre - scale * rotation @ source_centre)
