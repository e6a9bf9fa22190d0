"""Statistics of a model, rows that could mislead an audit, and values that seem to be stored in another way."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, Float64, Indices
from gspure.model.finite import FILTER, filtered, listed, non_finite_rows, undrawable_rows
from gspure.model.gaussians import COLOUR, CORE, NORMALS, Gaussians

QUANTILE_LEVELS = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)  # extremes, the middle 90 %, quartiles and median

NEEDLE_ASPECT: Final = 1e4  # largest ratio of the longest to the second longest axis; the shortest may be shorter
FAR: Final = 1e3  # largest distance of a centre from the median centre, as a multiple of the extent
PILE: Final = 10  # a pile is at least so many rows with the same centre
BULK: Final = (0.05, 0.95)  # the extent is the diagonal of the box between these quantiles of the centres

REASONS: Final = {  # why rows are suspicious
    "undrawable": "infinity or not-a-number, or a scale that overflows; not drawn",
    "needle": f"longest axis more than {NEEDLE_ASPECT:,.0f} times the second longest",
    "oversized": "scale larger than the extent of the scene",
    "far": f"centre farther away than {FAR:,.0f} times the extent of the scene",
    "duplicate": "exact copy of an earlier row",
    "pile": f"{PILE} or more rows with the same centre",
}

_KINDS: Final = {  # by column; the first that is present counts
    "f_anchor_feat_0": "Scaffold-GS or SecureGS (rows are anchors)",
    "semantic_0": "GS-Hider",
    FILTER: "GOF or Mip-Splatting (3-D filter)",
    "f_dc_0": "vanilla 3DGS (Splats in Splats looks the same)",
}
# Thresholds of ours. Scales, none of them negative, seem to be linear, not logarithms, in either of two cases:
_NEAR_ZERO: Final = 1 / 7  # the smallest is below this share of the median and below this number
_LARGE: Final = 1 / 10  # taken as logarithms, they make the median Gaussian larger than this share of the extent

_SAMPLED: Final = 50_000  # rows, spaced evenly, that are enough for doubts about a larger model; ours
_COARSE: Final = (1 / 20, 1 / 5000)  # largest step of coordinates: share of the median Gaussian, of the extent; ours


@dataclass(frozen=True)
class Summary:
    """Statistics of a model."""

    kind: str
    further_columns: tuple[str, ...]  # columns that vanilla models do not have
    quantiles: dict[str, tuple[float, ...]]  # of finite values at `QUANTILE_LEVELS`, world units; empty without one
    non_finite_rows: int  # rows with a not-a-number or a meaningless infinity in any column
    non_finite_columns: dict[str, tuple[int, int]]  # number of these rows in a column, and the first
    zero_quaternion_rows: int
    repeated_position_rows: int  # rows with exactly the centre of an earlier row
    suspicious: dict[str, Indices]  # `suspicious_rows`


@np.errstate(invalid="ignore")  # signalling not-a-numbers
def summarize(model: Gaussians) -> Summary:
    """Return statistics of `model`."""
    vanilla = {*CORE, *COLOUR, *NORMALS, *model.columns_named("f_rest_")}
    non_finite = non_finite_rows(model, model.names)
    quantities = dict(zip("xyz", model.means.T, strict=True)) | {"opacity": model.opacities}
    quantities |= {"largest_scale": model.scales.max(axis=1), "smallest_scale": model.scales.min(axis=1)}
    finite = model.means[np.isfinite(model.means).all(axis=1)]
    return Summary(
        kind=kind(model),
        further_columns=tuple(name for name in model.names if name not in vanilla),
        quantiles={name: _quantiles(values) for name, values in quantities.items()},
        non_finite_rows=len(set().union(*(rows.tolist() for rows in non_finite.values()))),
        non_finite_columns={name: (len(rows), int(rows[0])) for name, rows in non_finite.items()},
        zero_quaternion_rows=int(np.count_nonzero(~model.quats.any(axis=1))),
        repeated_position_rows=len(finite) - len(np.unique(_bits(finite))),
        suspicious=suspicious_rows(model),
    )


def kind(model: Gaussians) -> str:
    """Return the kind of a model, by its columns: the scheme or trainer that writes them."""
    return next((name for column, name in _KINDS.items() if column in model.names), "unknown")


def _quantiles(values: Float32) -> tuple[float, ...]:
    finite = values[np.isfinite(values)]
    return tuple(np.quantile(finite, QUANTILE_LEVELS).tolist()) if len(finite) else ()


def suspicious_rows(model: Gaussians) -> dict[str, Indices]:
    """Return the suspicious rows, sorted, for each of `REASONS` that applies; a row may have several.

    Scales include the 3-D filter.
    """
    undrawable = undrawable_rows(model)
    rows = np.delete(np.arange(len(model)), undrawable)
    scales = np.sort(filtered(model).scales[rows].astype(np.float64), axis=1)
    extent, distances = extent_and_distances(model.means[rows].astype(np.float64))
    _, place, sizes = np.unique(_bits(model.means[rows]), return_inverse=True, return_counts=True)
    rows_at_centre = sizes[place]
    stacked = rows[rows_at_centre > 1]
    _, originals = np.unique(np.array([model.table[row].tobytes() for row in stacked], object), return_index=True)
    by_reason = {
        "undrawable": undrawable,
        "needle": rows[scales[:, 2] > NEEDLE_ASPECT * scales[:, 1]],
        "oversized": rows[(scales[:, 2] > extent) & (extent > 0)],
        "far": rows[distances > FAR],
        "duplicate": np.delete(stacked, originals),
        "pile": rows[rows_at_centre >= PILE],
    }
    return {reason: matching for reason, matching in by_reason.items() if len(matching)}


def suspicious_lines(suspicious: Mapping[str, Indices], total: int) -> list[str]:
    """Return the suspicious rows of `total` as lines of text; empty if there are none."""
    if not suspicious:
        return []
    lines = [f"suspicious rows   {len(np.unique(np.concatenate([*suspicious.values()]))):,} of {total:,}"]
    for reason, rows in suspicious.items():
        noun = "rows" if len(rows) > 1 else "row"
        lines.append(f"  {reason:<12}{len(rows):>9,}   {REASONS[reason]}: {noun} {listed(rows)}")
    return lines


def _bits(means: Float32) -> NDArray[np.void]:
    """Return one value [K] for each finite centre [K,3], equal for equal centres."""
    return (means + np.float32(0)).view("V12").ravel()  # -0 becomes 0


def extent_of(means: Float64, bulk: tuple[float, float] = BULK) -> float:
    """Return the extent of finite centres [K,3]."""
    if not len(means):
        return 0.0
    low, high = np.quantile(means, bulk, axis=0)
    return float(np.linalg.norm(high - low))


def extent_and_distances(means: Float64, bulk: tuple[float, float] = BULK) -> tuple[float, Float64]:
    """Return the extent of finite centres [K,3], and their distances [K] from the median as multiples of it."""
    extent = extent_of(means, bulk)
    if not len(means):
        return extent, np.zeros(0)
    return extent, np.linalg.norm(means - np.median(means, axis=0), axis=1) / (extent or np.inf)


def doubts(model: Gaussians) -> list[str]:
    """Return a line of text for each doubt about the stored values of Gaussians, with a remedy."""
    model = model[:: max(len(model) // _SAMPLED, 1)]
    rows = np.isfinite(model.means).all(axis=1) & (model.log_scales < np.inf).all(axis=1)
    if model.has_anchors or not rows.any():
        return []
    means = model.means[rows]
    log_scales = model.log_scales[rows]
    extent = extent_of(means.astype(np.float64))
    size = float(np.exp(min(float(np.median(log_scales.max(axis=1))), 80)))
    lines = []
    activated = _activated(log_scales, model.table["opacity"][rows], size, extent)
    if activated:
        remedy = "apply these with gspure.read_model, with_columns and write_model"
        lines.append(f"values seem to be stored activated: {'; '.join(activated)}; {remedy}")
    farthest = np.abs(np.median(means, axis=0)).max()
    step = float(np.spacing(farthest))
    if step > min(_COARSE[0] * size, _COARSE[1] * extent or np.inf) > 0:
        loss = f"float32 steps of {step:.2g}, and the median Gaussian is {size:.2g} large: detail is lost"
        remedy = "subtract an offset from the coordinates of model and cameras before training or export"
        lines.append(f"coordinates around {farthest:.6g} have {loss}; {remedy}")
    return lines


def _activated(log_scales: Float32, opacity_logits: Float32, size: float, extent: float) -> list[str]:
    """Return the columns whose stored values look activated; `size` is that of the median Gaussian."""
    activated = []
    least = float(log_scales.min())
    if least >= 0 and (least < _NEAR_ZERO * min(float(np.median(log_scales)), 1) or size > _LARGE * extent):
        activated.append(f"scales of {least:.3g} to {log_scales.max():.3g}, where 3DGS has ln(scale)")
    low = opacity_logits.min()
    high = opacity_logits.max()
    if low >= 0 and 0 < high <= 1:
        activated.append(f"opacities of {low:.3g} to {high:.3g}, where 3DGS has ln(opacity / (1 - opacity))")
    return activated
