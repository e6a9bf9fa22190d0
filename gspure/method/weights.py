"""Weights: the contributions of Gaussians to the public views, averaged over the views."""

from collections.abc import Iterable, Sequence
from typing import Any, Final, Literal, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, Float64, Indices
from gspure.constants import NEAR_PLANE
from gspure.errors import InputError

View = TypeVar("View")
Reduction = Literal["sum", "max", "mean_touched"]
REDUCTIONS: Final[tuple[Reduction, ...]] = get_args(Reduction)

FEW_SHARE: Final = 0.01  # share of rows in view below which a warning is printed; ours
HELD_SHARE: Final = 0.99  # share of all ω; the diagnosis counts the heaviest rows that hold it; ours
LIGHT_FACTOR: Final = 5.0  # ratio of all rows to these heaviest rows above which a warning is printed; ours
HEAVY_SHARE: Final = 0.1  # share of all ω above which a row is heavy; below 1000 rows, 100 times the mean; ours


def view_weights(touched: NDArray[Any], reduction: Reduction = "sum") -> Float64:
    r"""Return ω_{k,v} of the Gaussians touched in one view, from its `gspure.renderer.CONTRIBUTION` records [T].

    .. math:: \omega_{k,v} = \alpha_k E(G_k, o_v, r_v) \prod_{j<k} (1 - \alpha_j E(G_j, o_v, r_v))

    (paper, §View-Aware Gaussian Weight Accumulation.) The equation is that of one ray. The paper does not define the
    reduction over the pixels of a view, so it is a setting. `sum` is the result of an atomic addition in a rasterizer;
    `max` is the largest pixel; `mean_touched` is the sum divided by the number of touched pixels.
    """
    if reduction in ("sum", "max"):
        return np.asarray(touched[reduction], np.float64)
    if reduction == "mean_touched":
        return np.asarray(touched["sum"].astype(np.float64) / touched["pixels"])
    raise InputError("weights", "reduction", expected=f"one of {', '.join(REDUCTIONS)}", found=repr(reduction))


def evenly_spread(views: Sequence[View], count: int) -> list[View]:
    """Return `count` views, evenly spread: the middle one of each of `count` equal parts.

    Raise `InputError` unless `count` is between 1 and the number of views.
    """
    if not 1 <= count <= len(views):
        raise InputError("weights", "views", expected=f"1 to {len(views)}, the number of views", found=str(count))
    return [views[(2 * part + 1) * len(views) // (2 * count)] for part in range(count)]


def accumulate(views: Iterable[NDArray[Any]], count: int, reduction: Reduction = "sum") -> Float32:
    r"""Return the weights ω_k of `count` Gaussians: float32 [K].

    .. math:: \omega_k = \frac{1}{N} \sum_{v=1}^{N} \omega_{k,v}

    (paper, §View-Aware Gaussian Weight Accumulation.) N counts every view, including those that do not show a Gaussian.
    Views are read one at a time and summed in float64 in the order of `views`, so the weights are bit-identical for any
    division of the views into parts. Raise `InputError` if there is no view.
    """
    total = np.zeros(count, np.float64)
    number = 0
    for touched in views:
        total[touched["index"]] += view_weights(touched, reduction)
        number += 1
    if not number:
        raise InputError("contributions", "views", expected="at least one", found="none")
    return (total / number).astype(np.float32)


def require_in_view(weights: NDArray[Any]) -> None:
    """Raise `InputError` if all weights are 0: no attack would seem to change a model that no view shows."""
    if not weights.any():
        hint = f"do cameras and model belong together, and is the model farther than {NEAR_PLANE} from the cameras?"
        raise InputError("weights", "rows", expected="at least one in view", found=f"none of {len(weights)}", hint=hint)


def heavy_rows(weights: NDArray[Any]) -> Indices:
    """Return the rows whose weight is so large that it shifts mean and standard deviation of all weights [K]."""
    bound = max(HEAVY_SHARE, 100 / max(len(weights), 1))
    return np.flatnonzero(weights > bound * weights.sum(dtype=np.float64))


def holding_rows(weights: NDArray[Any]) -> int:
    """Return the number of the heaviest rows that hold `HELD_SHARE` of all weights [K]; all rows if these are 0."""
    if not weights.any():
        return len(weights)
    held = np.cumsum(np.sort(weights)[::-1], dtype=np.float64)
    return int(np.searchsorted(held, HELD_SHARE * held[-1])) + 1


def few_in_view(weighted: int, rows: int) -> list[str]:
    """Return a warning, one sentence, if the views see few of the rows."""
    if weighted >= FEW_SHARE * rows:
        return []
    return [f"the views see {weighted} of {rows} rows: do cameras and model belong together?"]
