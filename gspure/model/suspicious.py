"""Rows that training does not produce, which an owner could plant to mislead or stop an audit."""

import hashlib
from collections.abc import Mapping
from typing import Final

import numpy as np

from gspure.files import Float32, Float64, Indices
from gspure.model.filtered import filtered
from gspure.model.finite import listed, undrawable_rows
from gspure.model.gaussians import Gaussians

Rows = Indices

NEEDLE_ASPECT: Final = 1e4
"""Largest ratio of the longest to the second longest axis; the shortest may be shorter, as surfaces are flat."""

FAR: Final = 1e3  # largest distance of a centre from the median centre, as a multiple of the extent
PILE: Final = 10  # least number of rows with the same centre that are a pile
BULK: Final = (0.05, 0.95)  # the extent is the diagonal of the box between these quantiles of the centres

REASONS: Final = {
    "undrawable": "infinity or not-a-number, or a scale that overflows; not drawn",
    "needle": f"longest axis more than {NEEDLE_ASPECT:,.0f} times the second longest",
    "oversized": "scale larger than the extent of the scene",
    "far": f"centre farther away than {FAR:,.0f} times the extent of the scene",
    "duplicate": "exact copy of an earlier row",
    "pile": f"{PILE} or more rows with the same centre",
}
"""Why rows are suspicious."""


def suspicious_rows(model: Gaussians) -> dict[str, Rows]:
    """Return the suspicious rows, sorted, for each of `REASONS` that applies; a row may have several.

    Scales include the 3-D filter.
    """
    undrawable = undrawable_rows(model)
    drawn = np.ones(len(model), bool)
    drawn[undrawable] = False
    rows = np.flatnonzero(drawn)
    means, scales = (
        model.means[rows].astype(np.float64),
        np.sort(filtered(model).scales[rows].astype(np.float64), axis=1),
    )
    extent, distances = extent_and_distances(means)
    pile, repeated = coincident_rows(model.means[rows])
    by_reason = {
        "undrawable": undrawable,
        "needle": rows[scales[:, 2] > NEEDLE_ASPECT * scales[:, 1]],
        "oversized": rows[(scales[:, 2] > extent) & (extent > 0)],
        "far": rows[distances > FAR],
        "duplicate": _copies(model, rows[np.sort(repeated)]),
        "pile": rows[np.sort(pile)],
    }
    return {reason: at for reason, at in by_reason.items() if len(at)}


def lines(suspicious: Mapping[str, Rows], total: int) -> list[str]:
    """Return the suspicious rows of `total` as lines of text; empty if there are none."""
    if not suspicious:
        return []
    count = len(np.unique(np.concatenate([*suspicious.values()])))
    return [f"suspicious rows   {count:,} of {total:,}", *(_line(reason, rows) for reason, rows in suspicious.items())]


def to_json(suspicious: Mapping[str, Rows]) -> dict[str, list[int]]:
    """Return all suspicious rows by reason, as plain numbers."""
    return {reason: rows.tolist() for reason, rows in suspicious.items()}


def coincident_rows(means: Float32) -> tuple[Rows, Rows]:
    """Return, for finite centres [K,3], the rows in piles, and all rows with the centre of another row."""
    order = np.lexsort(means.T)
    ordered = means[order]
    starts = np.flatnonzero(np.append(True, (ordered[1:] != ordered[:-1]).any(axis=1)))[: len(means)]
    sizes = np.diff(np.append(starts, len(means)))
    size_of = np.repeat(sizes, sizes)
    return order[size_of >= PILE], order[size_of > 1]


def extent_and_distances(means: Float64, bulk: tuple[float, float] = BULK) -> tuple[float, Float64]:
    """Return the extent of finite centres [K,3], and their distances [K] from the median, in extents."""
    if not len(means):
        return 0.0, np.zeros(0)
    low, high = np.quantile(means, bulk, axis=0)
    extent = float(np.linalg.norm(high - low))
    return extent, np.linalg.norm(means - np.median(means, axis=0), axis=1) / (extent or np.inf)


def _copies(model: Gaussians, rows: Rows) -> Rows:
    """Return those of `rows`, in ascending order, that are bit-identical to an earlier one."""
    digests: set[bytes] = set()
    copies = []
    for row in rows.tolist():
        digest = hashlib.blake2b(model.table[row].tobytes(), digest_size=16).digest()
        if digest in digests:
            copies.append(row)
        digests.add(digest)
    return np.array(copies, np.intp)


def _line(reason: str, rows: Rows) -> str:
    title, plural = reason.replace("_", "-"), "s" * (len(rows) > 1)
    return f"  {title:<12}{len(rows):>9,}   {REASONS[reason]}: row{plural} {listed(rows)}"
