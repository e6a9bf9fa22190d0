"""Densification: clone and split Gaussians with large gradients, prune transparent ones (Kerbl et al. 2023, 5.2).

3DGS's rule for Gaussians wider than 20 pixels on the screen is left out: its release zeroes those widths before the
test, so no published model was trained with it.
"""

from dataclasses import dataclass, replace
from types import EllipsisType
from typing import Final

import numpy as np

from gspure.arrays import Bools, Float32, Indices
from gspure.model.gaussians import logit, sigmoid
from gspure.opencl.trainable import DensificationStatistics, Parameters, TrainState

GRADIENT_THRESHOLD: Final = 2e-4  # a Gaussian grows where the mean norm of dL/d(projected centre), in NDC, reaches this
DENSE_SHARE: Final = 0.01  # of the scene's extent: growing Gaussians with no larger scale are cloned, others split
SPLIT_SHRINK: Final = 1.6  # each of the two halves of a split Gaussian is smaller by this factor
OPACITY_MIN: Final = 0.005  # Gaussians with a lower opacity are pruned
BIG_SHARE: Final = 0.1  # of the scene's extent: larger Gaussians are pruned after the first reset of opacities
RESET_OPACITY: Final = 0.01  # upper bound of opacities after a reset


@dataclass(frozen=True, eq=False)
class Growth:
    """The N Gaussians after densification: remaining ones, clones, first halves, second halves.

    `rows` [N] are their rows, or their parents' rows, before densification. `new` and `half` [N] are true for new
    Gaussians, and for halves of a split one. `offsets` [halves,3] lead from the centre of a split Gaussian to the
    centres of its halves.
    """

    rows: Indices
    new: Bools
    half: Bools
    offsets: Float32


def plan(
    parameters: Parameters,
    statistics: DensificationStatistics,
    opacities: Float32 | None = None,
    *,
    extent: float,
    prune_big: bool,
    rng: np.random.Generator,
    max_gaussians: int | None = None,
) -> Growth:
    """Decide which of K Gaussians grow and which are pruned, from `statistics` since the last densification.

    `opacities` [K] decide about pruning, by default those of `parameters`. `extent` is that of the scene in world
    units, and `rng` places the halves. Up to `max_gaussians`, those with the largest gradients grow first.
    """
    if opacities is None:
        opacities = sigmoid(parameters.opacity_logits)
    sizes = np.exp(parameters.log_scales).max(axis=1)
    grown = _grown(statistics, max_gaussians)
    split = grown & (sizes > DENSE_SHARE * extent)
    remaining = np.flatnonzero(~split)
    clones = np.flatnonzero(grown & ~split)
    parents = np.flatnonzero(split)
    rows = np.concatenate([remaining, clones, parents, parents])
    numbers = np.arange(len(rows))
    new = numbers >= len(remaining)
    half = numbers >= len(remaining) + len(clones)
    largest = BIG_SHARE * extent if prune_big else np.inf
    small = sizes[rows] / np.where(half, SPLIT_SHRINK, 1.0) <= largest
    stay = small & (opacities[rows] >= OPACITY_MIN)
    rows = rows[stay]
    half = half[stay]
    offsets = _offsets(parameters.rows(rows[half]), rng)
    return Growth(rows, new[stay], half, offsets)


def grow(state: TrainState, growth: Growth) -> TrainState:
    """Return the state after a growth; new Gaussians start with zero moments."""
    after = state.parameters.rows(growth.rows)
    first = state.first.rows(growth.rows)
    second = state.second.rows(growth.rows)
    after.means[growth.half] += growth.offsets
    after.log_scales[growth.half] -= np.float32(np.log(SPLIT_SHRINK))
    for moments in (*vars(first).values(), *vars(second).values()):
        moments[growth.new] = 0
    return TrainState(after, first, second)


def reset_opacities(state: TrainState, rows: Bools | EllipsisType = ...) -> TrainState:
    """Clip the opacities of some rows, by default of all, to `RESET_OPACITY`, and zero their moments."""
    logits = state.parameters.opacity_logits.copy()
    first = state.first.opacity_logits.copy()
    second = state.second.opacity_logits.copy()
    logits[rows] = np.minimum(logits[rows], logit(RESET_OPACITY))
    first[rows] = 0
    second[rows] = 0
    return TrainState(
        replace(state.parameters, opacity_logits=logits),
        replace(state.first, opacity_logits=first),
        replace(state.second, opacity_logits=second),
    )


def _grown(statistics: DensificationStatistics, max_gaussians: int | None) -> Bools:
    """Return the mask of the Gaussians that grow; each adds one."""
    gradients = statistics.gradient_norms / np.maximum(statistics.views, 1)
    grown: Bools = gradients >= GRADIENT_THRESHOLD
    if max_gaussians is not None:
        room = max(0, max_gaussians - len(grown))
        grown[np.argsort(-gradients, kind="stable")[room:]] = False
    return grown


def _offsets(parameters: Parameters, rng: np.random.Generator) -> Float32:
    """Sample one point of each Gaussian, relative to its centre."""
    quats = parameters.quats / np.linalg.norm(parameters.quats, axis=1, keepdims=True)
    scalar = quats[:, :1]
    vector = quats[:, 1:]
    local = np.exp(parameters.log_scales) * rng.standard_normal(parameters.means.shape)
    turned = 2 * np.cross(vector, local)  # q v q* = v + w t + u x t, with t = 2 u x v
    return np.asarray(local + scalar * turned + np.cross(vector, turned), np.float32)
