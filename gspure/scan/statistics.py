r"""Statistics that a message changes: of a model's file and, with public cameras, of its weights.

Clean models differ in them, too, so `gspure.scan.verdict` compares a model with clean ones.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from gspure.arrays import Bools, Float32, Indices, UInt32, UInt64
from gspure.constants import ALPHA_MIN
from gspure.model.gaussians import COLOUR, Gaussians
from gspure.opencl.storage import morton_order

WINDOWS: Final = 15  # of 8 neighbouring bits of a float32, whose mantissa has 23
FEW_VALUES: Final = 256  # a column with at most as many distinct values comes from a compressed format: no low bits
ROWS: Final = 20_000  # most rows of a column, evenly spread, whose bits are counted; ours
LEAST_ROWS: Final = 1000  # fewer bytes are too few for an entropy of up to 8 bits; ours
LEAST_MASK: Final = 20  # fewer rows do not show whether they clump; ours
TRANSPARENT: Final = ALPHA_MIN * (1 + 1e-4)  # 1/255 from 8 bits, with rounding


class Ranges(NamedTuple):
    """Properties of a model that bound where a statistic counts, each by its range in the calibration.

    Those in `least` must not be below their range, those in `most` not above it.
    """

    least: tuple[str, ...] = ()
    most: tuple[str, ...] = ()


ANY: Final = Ranges()
ENOUGH: Final = Ranges(least=("rows",))
OPACITY: Final = Ranges(least=("rows", "median_opacity"), most=("rows",))  # opaque models have few transparent rows
WEIGHT: Final = Ranges(least=("rows", "median_opacity"), most=("rows", "median_opacity"))  # opaque rows hide others


class Statistic(NamedTuple):
    """One statistic."""

    name: str
    meaning: str
    ranges: Ranges
    raised: bool  # whether a message raises it; else it lowers it
    is_share: bool

    @property
    def of_weights(self) -> bool:
        """Whether it needs the weights of the rows in the public views."""
        return self.ranges is WEIGHT


STATISTICS: Final = (
    Statistic("bit_entropy", "colours: least entropy of 8 low bits", ANY, raised=False, is_share=False),
    Statistic("never_drawn", "never drawn: share of the rows", OPACITY, raised=True, is_share=True),
    Statistic("never_drawn_clump", "never drawn: clumping", OPACITY, raised=True, is_share=False),
    Statistic("never_drawn_flat", "never drawn: chance of being flatter", OPACITY, raised=True, is_share=False),
    Statistic("repeated", "repeated centres: share of the rows", ENOUGH, raised=True, is_share=True),
    Statistic("unseen", "unseen: share of the rows", WEIGHT, raised=True, is_share=True),
    Statistic("unseen_clump", "unseen: clumping", WEIGHT, raised=True, is_share=False),
    Statistic("unseen_flat", "unseen: chance of being flatter", WEIGHT, raised=True, is_share=False),
)


def bit_entropy(model: Gaussians) -> float:
    r"""Return the least entropy of 8 neighbouring low bits of a stored colour, over columns and places, in bits.

    .. math:: \hat H = -\sum_{b=1}^{B} \hat p_b \log_2 \hat p_b + \frac{B - 1}{2 n \ln 2}

    of the B different bytes among the n rows that are not 0 (Miller 1955). Low bits of trained numbers are uniform:
    :math:`2 n \ln 2\,(8 - \hat H)`, uncorrected, is then about :math:`\chi^2` with 255 degrees of freedom. Bits that
    hold another number's exponent are not. NaN if no column has low bits.
    """
    names = [name for name in COLOUR if name in model.names] + [*model.columns_named("f_rest_")]
    step = max(1, -(-len(model) // ROWS))
    rows = model[::step]
    entropies = (entropy for name in names for entropy in _entropies(rows.table[name]))
    return min(entropies, default=np.nan)


def _entropies(column: Float32) -> Iterator[float]:
    """Yield the entropies of the windows of a column, without 8-bit colours of points that no view has trained."""
    words = np.ascontiguousarray(column[column != 0], np.float32).view(np.uint32)
    values, occurrences = np.unique(words, return_counts=True)
    if len(words) < LEAST_ROWS or len(values) <= FEW_VALUES:
        return
    trained = values[occurrences == 1]
    if len(values) - len(trained) <= FEW_VALUES and len(trained) >= LEAST_ROWS:
        words = trained
    varying = int(np.bitwise_or.reduce(words ^ words[0]))
    lowest = (varying & -varying).bit_length() - 1
    for start in range(lowest, max(WINDOWS, lowest + 1)):
        counts = np.bincount(words >> np.uint32(start) & np.uint32(255))
        shares = counts[counts > 0] / len(words)
        yield float((len(shares) - 1) / (2 * len(words) * np.log(2)) - shares @ np.log2(shares))


def never_drawn(model: Gaussians) -> Bools:
    """Return the rows [K] whose opacity is at most 1/255: no pixel of any view draws them."""
    return np.asarray(model.opacities <= TRANSPARENT)


def repeated(model: Gaussians) -> Bools:
    """Return the rows [K] whose centre is bit for bit that of another row, except for clones that await a view.

    A trainer's clones are equal in every column until a view shows them: just after they were made, or after a reset of
    the opacities. So of equal rows, only one counts if it could be drawn. Trainers prune those that could not.
    """
    words = (model.means + np.float32(0)).view(np.uint32).astype(np.uint64)  # -0 becomes 0
    is_shared = _shared(words)
    is_transparent = never_drawn(model)
    twins = np.flatnonzero(is_shared & ~is_transparent)
    values = np.ascontiguousarray(model.table[twins]).view(np.dtype((np.void, model.table.dtype.itemsize)))
    _, firsts = np.unique(values, return_index=True)
    kept = np.concatenate([twins[firsts], np.flatnonzero(is_shared & is_transparent)])
    counted = np.zeros(len(model), np.bool_)
    counted[kept] = _shared(words[kept])
    return counted


def _shared(centres: UInt64) -> Bools:
    """Return the rows of centres [K,3], as words, that equal another row."""
    mixed = centres @ np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
    order = np.argsort(mixed, kind="stable")
    equal = (centres[order[1:]] == centres[order[:-1]]).all(axis=1)
    shared = np.zeros(len(centres), np.bool_)
    shared[order[1:][equal]] = True
    shared[order[:-1][equal]] = True
    return shared


def clumping(mask: Bools, order: Indices | UInt32) -> float:
    r"""Return how much the rows of a mask [K] clump along a space-filling curve, up to 1; 0 at random.

    .. math:: 1 - \frac{(R - 1) K}{2 m (K - m)}

    for R runs of equal values, m of K true (Wald and Wolfowitz 1940). For a random mask, the mean is 0 and the standard
    deviation about :math:`K^{-1/2}`. The surfaces of a hidden scene clump, floaters hardly do. NaN for few rows.
    """
    count = int(mask.sum())
    total = len(mask)
    if min(count, total - count) < LEAST_MASK:
        return np.nan
    changes = int(np.count_nonzero(np.diff(mask[order])))
    return 1 - changes * total / (2 * count * (total - count))


def flatness(model: Gaussians, mask: Bools) -> float:
    r"""Return the probability that a row of the mask [K] is flatter than another row; 1/2 if both are as flat.

    .. math:: \frac{U}{m n}, \quad U = \#\{(i, j): f_i > f_j\} + \tfrac12 \#\{(i, j): f_i = f_j\}

    for the m rows i and the n others j (Mann and Whitney 1947), where f is the ratio of longest to shortest axis. For
    equal distributions, the standard deviation is :math:`\sqrt{(m + n + 1) / (12 m n)}`. Training flattens rows along
    the surfaces that a view shows; what no view has shown stays round. NaN for few rows.
    """
    if min(int(mask.sum()), int((~mask).sum())) < LEAST_MASK:
        return np.nan
    ratio = np.ptp(model.log_scales, axis=1)
    others = np.sort(ratio[~mask])
    below = np.searchsorted(others, ratio[mask], "left").mean()
    not_above = np.searchsorted(others, ratio[mask], "right").mean()
    return float(below + not_above) / (2 * len(others))


class Measured(NamedTuple):
    """The statistics of a model by name, NaN where one cannot be measured, and the rows [K] that they count."""

    values: dict[str, float]
    rows: dict[str, Bools]


def measure(model: Gaussians, weights: Float32 | None = None) -> Measured:
    """Return the statistics of K >= 1 Gaussians; with weights [K] in the public views, also those of the weights."""
    rows = {"never_drawn": never_drawn(model), "repeated": repeated(model)}
    if weights is not None:
        rows["unseen"] = (weights == 0) & ~rows["never_drawn"]
    order = morton_order(model.means)
    values = {"bit_entropy": bit_entropy(model)}
    values |= {name: float(mask.mean()) for name, mask in rows.items()}
    values |= {f"{name}_clump": clumping(mask, order) for name, mask in rows.items()}
    values |= {f"{name}_flat": flatness(model, mask) for name, mask in rows.items()}
    if len(np.unique(model.opacities)) <= FEW_VALUES:
        values |= {name: np.nan for name in values if name.startswith("never_drawn")}  # 8 bits round many to 1/255
    return Measured({s.name: values[s.name] for s in STATISTICS if s.name in values}, rows)
