"""Which rows of the published model the rows of an attacked one are, and how the attacked one moved."""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float64, Indices
from gspure.model.gaussians import Gaussians, finite
from gspure.model.rotations import moved
from gspure.model.summary import extent_and_distances
from gspure.public_model import PublicModel
from gspure.scenes.alignment import Similarity

Places = Indices

NEAR: Final = 1e-6  # least move of a row, as a share of the original's extent: text files are not exact; ours
NEIGHBOURS: Final = 8  # number of nearest rows of the original that a moved row may be; ours

ALIKE: Final = 1e-3
"""Largest product of distance, in median distances between neighbours, and difference of log-scales. Ours.

Noise on centres spares scales, and fine-tuning hardly moves centres; in rows of another training, both differ.
"""

MOST: Final = 0.5  # least share of the rows of model or original, whichever has fewer, that match by no chance; ours
LANDMARKS: Final = 100  # number of rows of unusual shape that a registration is fitted to; ours
STEPS: Final = 20  # steps of a registration; ours
STILL: Final = Similarity(1.0, np.eye(3), np.zeros(3))  # no motion


def exact_matches(original: NDArray[Any], means: NDArray[Any]) -> Places:
    """Return the index of each centre [K,3] in `original` [N,3], or -1. A far row does not widen the tolerance."""
    from scipy.spatial import KDTree

    if not len(original):
        return np.full(len(means), -1, np.intp)
    extent, _ = extent_and_distances(original.astype(np.float64))
    distances, places = KDTree(original).query(means)
    return np.where(distances <= NEAR * extent, places, -1)


def registered(public: PublicModel, original: Gaussians) -> PublicModel:
    """Return an attacked model moved to where the original is.

    Rows may have changed slightly, and all of them may have moved by a similarity. If fewer than `MOST` of them match
    after any of those tried, or if they match where they are, the model stays as it is.
    """
    from scipy.spatial.transform import Rotation

    if min(len(original), len(public.model)) < 2:
        return public
    motions = _motions(original, public.model)
    found = next((m for m in motions if (adaptive_matches(original, public.model, m) >= 0).any()), STILL)
    if found is STILL:
        return public
    rotvec = Rotation.from_matrix(found.rotation).as_rotvec()
    return public.with_model(moved(public.model, rotvec, found.translation, found.scale))


def adaptive_matches(original: Gaussians, model: Gaussians, motion: Similarity = STILL) -> Places:
    """Return the index of each row [K], somewhat changed, after `motion` in `original`, or -1; no two have the same."""
    from scipy.spatial import KDTree

    unmatched = np.full(len(model), -1, np.intp)
    if len(original) < 2:
        return unmatched
    tree, known = KDTree(original.means), _scales(original)
    spacing = float(np.median(tree.query(original.means, k=2)[0][:, 1]))
    points = motion.points(model.means.astype(np.float64))
    distances, places = tree.query(points, k=range(1, min(NEIGHBOURS, len(original)) + 1))
    scales = _scales(model) + np.log(motion.scale)
    products = distances * np.abs(scales[:, None] - known[places]).max(axis=2)
    likeliest = np.arange(len(model)), products.argmin(axis=1)
    candidates = np.flatnonzero(products[likeliest] <= ALIKE * spacing)
    nearest = candidates[np.argsort(distances[likeliest][candidates], kind="stable")]
    matched, first = np.unique(places[likeliest][nearest], return_index=True)
    if len(matched) < MOST * min(len(original), len(model)):
        return unmatched
    matches = unmatched.copy()
    matches[nearest[first]] = matched
    return matches


def _motions(original: Gaussians, model: Gaussians) -> Iterator[Similarity]:
    """Yield similarities from the model to the original: none; one fitted to equal scales; one to equal ratios."""
    from scipy.spatial import KDTree

    yield STILL
    known, shapes = _scales(original), _scales(model)
    for _ in range(2):
        distances, places = KDTree(known).query(shapes, k=2)
        landmarks = np.argsort(distances[:, 0] - distances[:, 1], kind="stable")[:LANDMARKS]
        here, there = model.means[landmarks], original.means[places[landmarks, 0]]
        yield _fitted(here.astype(np.float64), there.astype(np.float64))
        known, shapes = np.diff(known), np.diff(shapes)


def _scales(model: Gaussians) -> NDArray[Any]:
    """Return the log-scales [K,3] of each row, ascending."""
    return np.sort(finite(model.log_scales), axis=1)


def _fitted(source: Float64, target: Float64) -> Similarity:
    """Return the similarity that fits the nearer half of pairs of points best."""
    motion, half = _least_squares(source, target), -(-len(source) // 2)
    for _ in range(STEPS):
        nearest = np.argsort(np.linalg.norm(motion.points(source) - target, axis=1))[:half]
        motion = _least_squares(source[nearest], target[nearest])
    return motion


def _least_squares(source: Float64, target: Float64) -> Similarity:
    """Return the similarity with the least squared distances (Umeyama 1991)."""
    here, there = source.mean(axis=0), target.mean(axis=0)
    left, strengths, right = np.linalg.svd((target - there).T @ (source - here))
    signs = np.array([1, 1, np.sign(np.linalg.det(left @ right))])
    rotation = (left * signs) @ right
    sums = np.array([strengths @ signs, np.square(source - here).sum()])
    above, below = np.maximum(sums, np.finfo(np.float64).tiny)
    scale = float(above) / float(below)
    return Similarity(scale, rotation, there - scale * rotation @ here)
