"""The features of the clustering: standardized position, opacity and weight."""

from collections.abc import Collection
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Bools, Float64
from gspure.errors import InputError
from gspure.model.summary import extent_and_distances
from gspure.progress import warn

COLUMNS = ("x", "y", "z", "opacity", "weight")

PARTS: Final = {"position": COLUMNS[:3], "opacity": COLUMNS[3:4], "weight": COLUMNS[4:]}
"""The parts of the features; the clustering uses all of them, or some in an ablation."""

OUTLYING: Final = 10.0  # distance from the median centre, in extents of the scene, beyond which a row is outlying; ours
STRETCH: Final = 2.0  # outlying rows are left out if they increase a standard deviation by a larger factor; ours

_STRETCH_WARNED: Final = 1.1

_MIDDLE: Final = (0.25, 0.75)  # quantiles of the centres, whose box is the extent of the middle half
_REMOTE: Final = 20.0  # distance from the median centre, in extents of the middle half, beyond which a row is remote
_REMOTE_SHARE: Final = 0.05  # of remote rows, above which a warning is printed: so many stretch the extent itself

LARGEST: Final = 1e6
"""Largest feature of a row that is left out; counted rows are at most at the square root of their number. Ours."""


def standardize(columns: NDArray[Any], counted: Bools | slice = slice(None)) -> Float64:
    r"""Return each column [K,C] with mean 0 and standard deviation 1; a constant column becomes 0.

    .. math:: (x - \mu) / \sigma

    Mean and standard deviation are those of the `counted` rows; other rows are clipped to `LARGEST`. The values of a
    row do not depend on the order of the rows.
    """
    columns = np.asarray(columns, np.float64)
    if not len(columns):
        return columns.copy()
    ordered = np.sort(columns[counted].T, axis=1)  # sums over sorted values do not depend on the order of rows
    mean = ordered.mean(axis=1)
    deviation = ordered.std(axis=1)
    # Rounding in the mean can give a constant column a deviation of 1e-17.
    constant = ordered[:, 0] == ordered[:, -1]
    standardized: Float64 = np.divide(columns - mean, deviation, out=np.zeros_like(columns), where=~constant)
    return standardized.clip(-LARGEST, LARGEST)


def joint_features(means: NDArray[Any], opacities: NDArray[Any], weights: NDArray[Any]) -> Float64:
    r"""Return the joint features F_k of position, opacity and weight: float64 [K,5].

    .. math::
        F_k = \mathrm{Concat}\left(\frac{p_k - \mu_p}{\sigma_p}, \frac{\alpha_k - \mu_\alpha}{\sigma_\alpha},
        \frac{\omega_k - \mu_\omega}{\sigma_\omega}\right)

    (paper, §Geometrically Accurate Feature Clustering.) Positions, in world units, are standardized per coordinate.
    A single far row can make all other positions nearly equal, so `OUTLYING` rows that increase a standard deviation
    by more than `STRETCH` are left out of means and standard deviations, with a warning.

    Raise `InputError` if any value is not finite, with the number of such rows and the first of them.
    """
    raw = np.column_stack([means, opacities, weights]).astype(np.float64)
    bad = ~np.isfinite(raw)
    if bad.any():
        rows = np.flatnonzero(bad.any(axis=1))
        names = ", ".join(COLUMNS[i] for i in np.flatnonzero(bad.any(axis=0)))
        offending = f"others in {len(rows)} of {len(raw)} rows, first in row {rows[0]}"
        raise InputError("features", names, expected="finite values", found=offending)
    return standardize(raw, _counted(raw[:, :3]))


def _counted(means: Float64) -> Bools | slice:
    """Return the rows that count in means and standard deviations; warn of outlying rows that change them."""
    inner = extent_and_distances(means)[1] <= OUTLYING
    remote = inner & (extent_and_distances(means, _MIDDLE)[1] > _REMOTE)
    if remote.sum() > _REMOTE_SHARE * len(remote):
        far = f"farther from the median centre than {_REMOTE:g} times the extent of the central 50 % of the centres"
        consequence = "They are too many to leave out, so they compress the positions of the others; remove them first"
        warn(f"features: {remote.sum()} of {len(remote)} rows are {far}. {consequence}")
    if inner.all():
        return slice(None)
    deviation = np.sort(means, axis=0).std(axis=0)
    inner_deviation = np.sort(means[inner], axis=0).std(axis=0)
    with np.errstate(over="ignore"):
        stretch = float((deviation / np.maximum(inner_deviation, np.finfo(float).tiny)).max())
    if stretch > _STRETCH_WARNED:
        rows = f"rows beyond {OUTLYING:g} extents: {np.sum(~inner)} of {len(inner)}"
        consequence = ", so they are left out of the standardization" if stretch > STRETCH else ""
        warn(f"features: {rows} stretch the positions {stretch:.3g} times{consequence}")
    return inner if stretch > STRETCH else slice(None)


def take(joint: Float64, parts: Collection[str]) -> Float64:
    """Return the columns of the `joint` features [K,5] that belong to these `PARTS`, in the order of `COLUMNS`.

    Columns are standardized one by one, so they do not depend on the others.
    """
    is_taken = [any(column in PARTS[part] for part in parts) for column in COLUMNS]
    return joint[:, is_taken]
