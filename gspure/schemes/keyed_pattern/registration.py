"""Registration of a model whose rows are new: iterative closest points, from many rotations."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from gspure.arrays import Float64
from gspure.model.gaussians import Gaussians
from gspure.model.rotations import moved
from gspure.public_model import PublicModel
from gspure.scenes.alignment import Similarity
from gspure.schemes.matching import adaptive_matches, least_squares, registered

LEAST: Final = 4  # rows that fix a motion
OPAQUE: Final = 0.3  # least opacity of the rows that are compared; ours
POINTS: Final = 2500  # of them at most; ours
STARTS: Final = 24  # random rotations, besides those about the axes; ours
TURNS: Final = 12  # rotations about each axis, evenly spaced; ours
TRIAL_STEPS: Final = 8  # from each start; ours
STEPS: Final = 200  # from the best one; ours
KEPT: Final = 0.8  # share of the points, the nearest, that a step fits; ours


def placements(public: PublicModel, original: Gaussians) -> Iterator[Gaussians]:
    """Yield the drawn rows of an attacked model, moved back to where the original may be.

    Rows that match show the motion exactly. New rows are tried as they are, and with their centres as near to those of
    the original as possible.
    """
    from scipy.spatial.transform import Rotation

    model = registered(public.drawn("model"), original).model
    yield model
    if min(len(model), len(original)) < LEAST or (adaptive_matches(original, model) >= 0).any():
        return
    motion = closest_points(original, model)
    yield moved(model, Rotation.from_matrix(motion.rotation).as_rotvec(), motion.translation, motion.scale)


def closest_points(original: Gaussians, model: Gaussians) -> Similarity:
    """Return the similarity from a model to the original after which its opaque centres lie nearest to those there."""
    from scipy.spatial import KDTree

    target = _opaque(original)
    source = _opaque(model)
    source = np.random.default_rng(0).permutation(source)[:POINTS]
    tree = KDTree(target)

    def refined(motion: Similarity, steps: int, *, scales: bool) -> tuple[float, Similarity]:
        """Return a motion after some steps, perhaps of its scale, too, and the mean distance of the nearest points."""
        for _ in range(steps):
            distances, places = tree.query(motion.points(source))
            near = distances <= np.quantile(distances, KEPT)
            fitted = least_squares(source[near], target[places[near]])
            motion = fitted if scales else _rescaled(fitted, motion.scale, source[near].mean(axis=0))
        distances, _ = tree.query(motion.points(source))
        return float(np.minimum(distances, np.quantile(distances, KEPT)).mean()), motion

    trials = [refined(start, TRIAL_STEPS, scales=False) for start in _starts(source, target)]
    _, best = min(trials, key=lambda trial: trial[0])
    return refined(best, STEPS, scales=True)[1]


def _rescaled(motion: Similarity, scale: float, fixed: Float64) -> Similarity:
    """Return a motion with another scale that moves a fixed point to the same place."""
    shift = (motion.scale - scale) * motion.rotation @ fixed
    return Similarity(scale, motion.rotation, motion.translation + shift)


def _opaque(model: Gaussians) -> Float64:
    """Return the centres of the opaque rows; of all, if too few are."""
    means = model.means.astype(np.float64)
    opaque = means[model.opacities > OPAQUE]
    return opaque if len(opaque) >= LEAST else means


def _starts(source: Float64, target: Float64) -> Iterator[Similarity]:
    """Yield similarities that bring the median and the size of one set of points to those of another."""
    from scipy.spatial.transform import Rotation

    source_centre = np.median(source, axis=0)
    target_centre = np.median(target, axis=0)
    scale = _size(target, target_centre) / _size(source, source_centre)
    angles = np.arange(1 - TURNS // 2, 1 + TURNS // 2) * 2 * np.pi / TURNS
    about_axes = [axis * angle for axis in np.eye(3) for angle in angles]
    rotations = Rotation.concatenate([Rotation.from_rotvec(about_axes), Rotation.random(STARTS, random_state=0)])
    for rotation in rotations.as_matrix():
        yield Similarity(scale, rotation, target_centre - scale * rotation @ source_centre)


def _size(points: Float64, centre: Float64) -> float:
    return max(float(np.median(np.linalg.norm(points - centre, axis=1))), 1e-30)
