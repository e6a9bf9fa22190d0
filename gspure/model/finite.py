"""What is drawn of a model: rows whose numbers are finite, with the 3-D filter of Mip-Splatting and GOF.

Some infinities have a meaning: a logit of opacity 0 or 1, and the logarithm of a size of 0. They are drawn. The filter,
a smoothing of each Gaussian, is stored beside its scales and opacity (Yu et al., Mip-Splatting: Alias-free 3D Gaussian
Splatting, CVPR 2024, equation 9).
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, Float64, Indices
from gspure.errors import InputError
from gspure.model.gaussians import COLOUR, CORE, LEAST_OPACITY, NOTHING, SCALES, Gaussians, logit
from gspure.progress import warn

FILTER: Final = "filter_3D"  # column of its standard deviation, world units

_LARGEST_LOG_SCALE: Final = float(np.log(np.finfo(np.float32).max))
_MEANINGFUL: Final = {"opacity": (-np.inf, np.inf)} | dict.fromkeys(SCALES, (-np.inf,))
_LISTED: Final = 10


def non_finite_rows(model: Gaussians, names: Iterable[str]) -> dict[str, Indices]:
    """Return the rows with a not-a-number or an infinity without a meaning, for each of the named columns with any."""
    parts_by_name: dict[str, list[Indices]] = {name: [] for name in names}
    for rows, block in model.blocks():
        for name, parts in parts_by_name.items():
            if not (finite := np.isfinite(block[name])).all():
                finite |= np.isin(block[name], _MEANINGFUL.get(name, ()))
                parts.append(rows.start + np.flatnonzero(~finite))
    rows_by_name = {name: np.concatenate(parts) for name, parts in parts_by_name.items() if parts}
    return {name: rows for name, rows in rows_by_name.items() if len(rows)}


def undrawable_rows(model: Gaussians) -> Indices:
    """Return the rows that cannot be drawn, sorted: a number in them has no meaning, or a scale overflows float32."""
    return np.unique(np.concatenate([np.empty(0, np.intp), *_undrawable(model).values()]))


def drawable(model: Gaussians, source: str | Path) -> Gaussians:
    """Return a model as it is drawn: with the 3-D filter in its scales and opacities, and no row that cannot be drawn.

    Such rows become invisible, with a warning, so that a planted one cannot stop an audit: numbers without a meaning
    are replaced by the median of their column, and the opacity by 0. Other models are returned unchanged.

    Raise `InputError` if no row can be drawn, or rows are anchors, whose opacity a network computes.
    """
    if not model.has_anchors and len(unturned := np.flatnonzero(~model.quats.any(axis=1))):
        count = f"{len(unturned)} of {len(model)} rows"
        warn(f"{source}: {count} have a zero quaternion and are not drawn: {listed(unturned)}")
    undrawable = _undrawable(model)
    if not undrawable:
        return filtered(model)
    rows = undrawable_rows(model)
    if len(rows) == len(model) or model.has_anchors:
        _refuse(model, source, *next(iter(undrawable.items())))
    warn(f"{source}: {len(rows)} of {len(model)} rows are not finite and are not drawn: {listed(rows)}")
    values = {name: model.columns(name)[:, 0] for name in ("opacity", *undrawable)}
    for name in undrawable.keys() - {"opacity"}:
        values[name][undrawable[name]] = np.median(np.delete(values[name], undrawable[name]))
    values["opacity"][rows] = NOTHING
    return filtered(model.with_columns(values))


def filtered(model: Gaussians) -> Gaussians:
    """Return a model whose scales and opacities include its filter, which becomes 0; without one, the model itself.

    The filter adds its variance to that of each axis, and lowers the opacity by the ratio of the volumes. Programs that
    apply filters draw both models in the same way.
    """
    if FILTER not in model.names or not model.table[FILTER].any():
        return model
    sizes = model.columns(FILTER)[:, 0]
    rows = np.flatnonzero((sizes != 0) & (model.opacities > 0))
    scales, opacity = model.log_scales, model.columns("opacity")[:, 0]
    wider = widened(scales[rows], sizes[rows])
    shares = np.exp((scales[rows] - wider).sum(axis=1))
    scales[rows], opacity[rows] = wider, logit(model.opacities[rows] * shares, LEAST_OPACITY)
    values = dict(zip(SCALES, scales.T, strict=True)) | {"opacity": opacity, FILTER: np.zeros(len(model))}
    return model.with_columns(values)


def widened(log_scales: Float32, sizes: NDArray[Any]) -> Float64:
    """Return log(sqrt(s^2 + f^2)) of the scales s [K,3] of Gaussians and the standard deviations f [K] of filters."""
    variances = np.square(sizes, dtype=np.float64)[:, None]
    return np.asarray(np.logaddexp(2 * log_scales.astype(np.float64), np.log(variances)) / 2)


def require_finite(model: Gaussians, source: str | Path) -> None:
    """Refuse a model unless geometry, opacity and colour are finite, as stored, or infinities with a meaning."""
    for name, rows in non_finite_rows(model, _drawn_columns(model)).items():
        _refuse(model, source, name, rows)


def require_computed(results: Gaussians | Float32, source: str | Path, network: str) -> None:
    """Refuse the numbers that a network computed if any is not finite, or Gaussians if most cannot be drawn.

    A few Gaussians may overflow because of rows that an attack added, which must not stop an audit: none is drawn.
    """
    if isinstance(results, Gaussians):
        bad, total, unit, most = len(undrawable_rows(results)), len(results), "Gaussians", len(results) // 2
    else:
        bad, total, unit, most = int(np.count_nonzero(~np.isfinite(results))), results.size, "numbers", 0
    if bad > most:
        found = f"infinity or not-a-number in {bad} of {total} {unit}"
        raise InputError(source, network, expected="finite results", found=found, hint="network parameters too large?")


def _drawn_columns(model: Gaussians) -> list[str]:
    """Return the columns that an image depends on: geometry, opacity, filter, and colours or features."""
    colours = (*COLOUR, *model.columns_named("f_rest_"), *model.columns_named("semantic_"))
    return [*CORE, *(name for name in (*colours, FILTER) if name in model.names)]


def _undrawable(model: Gaussians) -> dict[str, Indices]:
    """Return the rows that cannot be drawn, for each column that prevents it."""
    undrawable = non_finite_rows(model, _drawn_columns(model))
    for name in SCALES:
        column = model.columns(name)[:, 0]
        if len(rows := np.flatnonzero(~(column <= _LARGEST_LOG_SCALE))):
            undrawable[name] = rows
    return undrawable


def _refuse(model: Gaussians, source: str | Path, name: str, rows: Indices) -> None:
    found = f"infinity or not-a-number in {len(rows)} of {len(model)} rows, first in row {rows[0]}"
    raise InputError(source, name, expected="finite numbers", found=found, hint="`gspure info` counts them all")


def listed(rows: Sequence[int | str] | Indices) -> str:
    """Return the first rows, or names, as text."""
    return ", ".join(map(str, rows[:_LISTED])) + ", ..." * (len(rows) > _LISTED)
