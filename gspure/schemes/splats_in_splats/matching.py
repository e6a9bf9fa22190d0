"""Which rows of the owner's record the rows of an attacked model are."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.model.gaussians import Gaussians
from gspure.scenes.alignment import Similarity

Float64 = NDArray[np.float64]
Places = NDArray[np.intp]

NEAR: Final = 1e-6
"""Largest distance of an unmoved row, as a share of the record's extent: text files are not exact. Ours."""

NEIGHBOURS: Final = 8
"""Number of nearest rows of the record that a moved row may be. Ours."""

ALIKE: Final = 1e-3
"""Largest product of distance, in median distances between neighbours, and difference of log-scales. Ours.

Noise on centres spares scales, and fine-tuning hardly moves centres; in rows of another training, both differ.
"""

MOST: Final = 0.5
"""Least share of the rows of model or record, whichever has fewer, that match; fewer may be chance. Ours.

Pruning leaves fewer rows than the record has, injection more.
"""

LANDMARKS: Final = 100
"""Number of rows of unusual shape that a registration is fitted to. Ours."""

STEPS: Final = 20
"""Steps of a registration. Ours."""


def exact_matches(record: NDArray[Any], means: NDArray[Any]) -> Places:
    """Return the index of each centre [K,3] in `record` [N,3], or -1."""
    from scipy.spatial import KDTree

    if not len(record):
        return np.full(len(means), -1, np.intp)
    distances, places = KDTree(record).query(means)
    return np.where(distances <= NEAR * float(np.ptp(record, axis=0).max()), places, -1)


def adaptive_matches(record: Gaussians, model: Gaussians) -> tuple[Places, Float64]:
    """Return the index of each row [K] in `record`, or -1, and the rotation vector of the model.

    Rows may have changed slightly, and all of them may have moved by a similarity. If fewer than `MOST` match, none
    does.
    """
    from scipy.spatial.transform import Rotation

    if len(record) > 1:
        for motion in _motions(record, model):
            places = _matches(record, model, motion)
            if (places >= 0).sum() >= MOST * min(len(record), len(model)):
                return places, Rotation.from_matrix(motion.rotation.T).as_rotvec()
    return np.full(len(model), -1, np.intp), np.zeros(3)


def _motions(record: Gaussians, model: Gaussians) -> Iterator[Similarity]:
    """Yield similarities from the model to the record: none; fitted to equal scales; fitted to equal ratios of them."""
    from scipy.spatial import KDTree

    yield Similarity(1.0, np.eye(3), np.zeros(3))
    known, shapes = _scales(record), _scales(model)
    for _ in range(2):
        distances, places = KDTree(known).query(shapes, k=2)
        landmarks = np.argsort(distances[:, 0] - distances[:, 1], kind="stable")[:LANDMARKS]
        yield _fitted(model.means[landmarks].astype(np.float64), record.means[places[landmarks, 0]].astype(np.float64))
        known, shapes = np.diff(known), np.diff(shapes)


def _matches(record: Gaussians, model: Gaussians, motion: Similarity) -> Places:
    """Return the index of each row after `motion`, or -1; no two rows have the same."""
    from scipy.spatial import KDTree

    tree, known = KDTree(record.means), _scales(record)
    spacing = float(np.median(tree.query(record.means, k=2)[0][:, 1]))
    points = motion.points(model.means.astype(np.float64))
    distances, places = tree.query(points, k=range(1, min(NEIGHBOURS, len(record)) + 1))
    scales = _scales(model) + np.log(motion.scale)
    products = distances * np.abs(scales[:, None] - known[places]).max(axis=2)
    likeliest = np.arange(len(model)), products.argmin(axis=1)
    candidates = np.flatnonzero(products[likeliest] <= ALIKE * spacing)
    nearest = candidates[np.argsort(distances[likeliest][candidates], kind="stable")]
    matched, first = np.unique(places[likeliest][nearest], return_index=True)
    matches = np.full(len(model), -1, np.intp)
    matches[nearest[first]] = matched
    return matches


def _scales(model: Gaussians) -> NDArray[Any]:
    """Return the log-scales [K,3] of each row, ascending."""
    return np.sort(model.columns("scale_0", "scale_1", "scale_2"), axis=1)


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
    scale = _positive(strengths @ signs) / _positive(np.square(source - here).sum())
    return Similarity(scale, rotation, there - scale * rotation @ here)


def _positive(number: float) -> float:
    return max(float(number), np.finfo(np.float64).tiny)
