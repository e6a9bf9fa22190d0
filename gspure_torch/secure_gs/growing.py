"""When anchors learn, and where they grow and are pruned (Scaffold-GS, section 3.3).

With region-aware density optimization (RDO, SecureGS), the scene's anchors grow denser around the hidden object.
DBSCAN finds the region where the hidden branch has large gradients. Inside its bounding box, the scene's threshold for
growing is divided by r_down, so that the density of anchors does not reveal the object's shape. The paper does not give
the parameters of the clustering; ours.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Bools, Float32, Indices
from gspure.training.fast import Stage
from gspure.training.schedule import ITERATIONS, LEAST_EVERY
from gspure_torch.secure_gs.anchors import SCALINGS, Anchors, Neural

OFFSETS_RATES: Final = (1e-2, 1e-4)  # first and last one, as a share of the scene's extent; log-linear between them
FEATURES_RATE: Final = 7.5e-3
SCALINGS_RATE: Final = 7e-3
NETWORK_RATES: Final = {"opacity": (2e-3, 2e-5), "cov": (4e-3, 4e-3), "color": (8e-3, 5e-5), "offset": (4e-3, 4e-5)}
"""First and last. The rate of SecureGS's offset network is ours: that of ``cov``, with the decay of offsets."""

COUNT_FROM: Final = 500
ADJUST_FROM: Final = 1_500
ADJUST_UNTIL: Final = 15_000
ADJUST_EVERY: Final = 100

STAGES: Final = (Stage(0.25, 4, 1.0), Stage(0.6, 2, 1.0), Stage(1.0, 1, 1.0))
"""Of the fast schedule: longer ones than those of Gaussians, as networks cost as much for small photographs. Ours."""


@dataclass(frozen=True)
class AnchorSchedule:
    """Scaffold-GS's schedule, scaled to `iterations`. They count from 1; events follow the optimizer step.

    Rates fall after the share `falls_from` of the run.
    """

    iterations: int
    falls_from: float = 0.0

    @property
    def adjust_every(self) -> int:
        """Number of iterations from one adjustment to the next."""
        return max(self._scaled(ADJUST_EVERY), LEAST_EVERY)

    def rates(self, iteration: int, extent: float) -> dict[str, float]:
        """Return the learning rates of one iteration by parameter; `extent` is the scene's, in world units."""
        share = max(0.0, (iteration / self.iterations - self.falls_from) / (1 - self.falls_from))
        rates = {name: first * (last / first) ** share for name, (first, last) in NETWORK_RATES.items()}
        first, last = OFFSETS_RATES
        offsets = extent * first * (last / first) ** share
        return rates | {"offsets": offsets, "features": FEATURES_RATE, "log_scalings": SCALINGS_RATE}

    def counts(self, iteration: int) -> bool:
        """Return whether statistics are collected at this iteration."""
        return self._scaled(COUNT_FROM) < iteration < self._scaled(ADJUST_UNTIL)

    def adjusts(self, iteration: int) -> bool:
        """Return whether anchors grow and are pruned after this iteration."""
        within = self._scaled(ADJUST_FROM) < iteration < self._scaled(ADJUST_UNTIL)
        return within and iteration % self.adjust_every == 0

    def _scaled(self, iteration: int) -> int:
        return round(iteration * self.iterations / ITERATIONS)


class AnchorStatistics:
    """Sums over the views of one branch since their last reset, for `count` = M anchors of k Gaussians."""

    def __init__(self, count: int, k: int) -> None:
        self.norms = np.zeros((count, k), np.float32)  # of the gradients: see `gspure_torch.rows.screen_norms`
        self.active_views = np.zeros((count, k), np.float32)  # number of views in which a Gaussian was active
        self.centres = np.zeros((count, k, 3), np.float32)  # of the Gaussian in those views
        self.opacities = np.zeros(count, np.float32)  # of an anchor
        self.views = np.zeros(count, np.float32)  # number of views in which it was visible

    def add(self, rows: Indices, gaussians: Neural, norms: Float32) -> None:
        """Add a view: the `rows` [V] of its anchors, their Gaussians (as arrays), the norms [A] of their gradients."""
        k = self.active_views.shape[1]
        self.views[rows] += 1
        self.opacities[rows] += np.maximum(gaussians.outputs, 0).sum(axis=1)
        active = rows[gaussians.active // k] * k + gaussians.active % k
        self.active_views.reshape(-1)[active] += 1
        self.norms.reshape(-1)[active] += norms
        self.centres.reshape(-1, 3)[active] += gaussians.means

    def mean_norms(self) -> Float32:
        """Return the mean norm [M,k] of each Gaussian over the views where it was active; else 0."""
        return np.asarray(self.norms / np.maximum(self.active_views, np.float32(1)))

    def mean_centres(self) -> Float32:
        """Return the mean centre [M,k,3] of each Gaussian over the views where it was active; else 0."""
        return np.asarray(self.centres / np.maximum(self.active_views, np.float32(1))[..., None])

    def restart(self, gaussians: Bools, anchors: Bools, rows: Indices, new: int) -> None:
        """Reset the sums of some Gaussians [M,k] and anchors [M]; then keep the anchors `rows`, append `new` ones."""
        for sums in (self.norms, self.active_views, self.centres):
            sums[gaussians] = 0
        self.opacities[anchors] = 0
        self.views[anchors] = 0
        for name, sums in vars(self).items():
            setattr(self, name, np.concatenate([sums[rows], np.zeros((new, *sums.shape[1:]), np.float32)]))


GRADIENT_THRESHOLD: Final = 2e-4  # tau of the first level; it doubles with each level (Scaffold-GS)
CELLS: Final = (16, 4, 1)  # sides of a new anchor's cell, in voxels, from the first level to the last (Scaffold-GS)
NEIGHBOURS: Final = 10  # DBSCAN's min_samples; ours
RADIUS: Final = 16  # DBSCAN's eps in voxels: the side of the largest cell of a new anchor; ours


class Candidates(NamedTuple):
    """Gaussians that may get a new anchor."""

    positions: Float32  # [C,3], centres, world units
    norms: Float32  # [C], mean norms of their gradients
    thresholds: Float32  # [C] of these norms, at the first level
    features: Float32  # [C,F] of their anchors


def grown(
    positions: Float32, candidates: Candidates, voxel: float, k: int, room: int, rng: np.random.Generator
) -> Anchors:
    """Return new anchors [N <= room], at most one per cell without an anchor.

    At level i, a candidate counts if its gradient reaches 2^i times its threshold, with a probability of 1 - 2^-(i+1).
    A new anchor has the channel-wise largest features of its candidates, and zero offsets.
    """
    parts: list[Anchors] = []
    for level, cell in enumerate(CELLS):
        side = np.float32(voxel * cell)
        chosen = candidates.norms >= candidates.thresholds * 2**level
        chosen &= rng.random(len(chosen)) > 0.5 ** (level + 1)
        cells, owners = np.unique(np.rint(candidates.positions[chosen] / side), axis=0, return_inverse=True)
        owners = owners.reshape(-1)
        strongest = np.zeros(len(cells), np.float32)
        np.maximum.at(strongest, owners, candidates.norms[chosen])
        features = np.full((len(cells), candidates.features.shape[1]), -np.inf, np.float32)
        np.maximum.at(features, owners, candidates.features[chosen])
        present = np.concatenate([positions, *(part.positions for part in parts)])
        is_occupied = np.isin(_keys(cells), _keys(np.rint(present / side)))
        empty = np.flatnonzero(~is_occupied)
        best = np.sort(empty[np.argsort(-strongest[empty], kind="stable")[:room]])
        room -= len(best)
        log_scalings = np.full((len(best), SCALINGS), np.log(side), np.float32)
        offsets = np.zeros((len(best), k, 3), np.float32)
        parts.append(Anchors((cells[best] * side).astype(np.float32), offsets, features[best], log_scalings))
    return joined(*parts)


def joined(*parts: Anchors) -> Anchors:
    """Return all anchors of `parts`, in their order."""
    return Anchors(
        positions=np.concatenate([part.positions for part in parts]),
        offsets=np.concatenate([part.offsets for part in parts]),
        features=np.concatenate([part.features for part in parts]),
        log_scalings=np.concatenate([part.log_scalings for part in parts]),
    )


def _keys(cells: NDArray[np.floating]) -> NDArray[np.int64]:
    """Return one number per cell [N,3]; indices are clipped to 2^20 cells from the origin."""
    half = 1 << 20
    x, y, z = (np.clip(cells, -half, half - 1).astype(np.int64) + half).T
    return np.asarray((x << 42) | (y << 21) | z)


def in_box(positions: Float32, hidden: Float32, voxel: float) -> Bools:
    """Return the mask of the positions [...,3] in the box around the clusters of `hidden` ones [C,3]."""
    from sklearn.cluster import DBSCAN

    if len(hidden):
        hidden = hidden[DBSCAN(eps=RADIUS * voxel, min_samples=NEIGHBOURS).fit(hidden).labels_ >= 0]
    lowest = hidden.min(axis=0, initial=np.inf)
    highest = hidden.max(axis=0, initial=-np.inf)
    return np.asarray(((positions >= lowest) & (positions <= highest)).all(axis=-1))
