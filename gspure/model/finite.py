"""The drawable rows of a model: those with finite numbers, and with the 3-D filter of Mip-Splatting and GOF applied.

Some infinities have a meaning: a logit of opacity 0 or 1, and the logarithm of a size of 0. They are drawn. The filter
smooths each Gaussian, and is stored beside its scales and opacity (Yu et al., Mip-Splatting: Alias-free 3D Gaussian
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
    """Return the rows with a not-a-number or a meaningless infinity, for each of the named columns that has any."""
    parts_by_name: dict[str, list[Indices]] = {name: [] for name in names}
    for rows, block in model.blocks():
        if _is_finite(block):
            continue
        for name, parts in parts_by_name.items():
            finite = np.isfinite(block[name])
            if not finite.all():
                finite |= np.isin(block[name], _MEANINGFUL.get(name, ()))
                parts.append(rows.start + np.flatnonzero(~finite))
    rows_by_name = {name: np.concatenate(parts) for name, parts in parts_by_name.items() if parts}
    return {name: rows for name, rows in rows_by_name.items() if len(rows)}


def _is_finite(block: NDArray[np.void]) -> bool:
    """Return whether rows without gaps, all of float32, are finite: faster than column by column."""
    names = block.dtype.names or ()
    is_dense = block.flags.c_contiguous and block.dtype.itemsize == 4 * len(names)
    if not is_dense or any(block.dtype[name] != np.float32 for name in names):
        return False
    return bool(np.isfinite(block.view(np.float32)).all())


def undrawable_rows(model: Gaussians) -> Indices:
    """Return the rows that cannot be drawn, sorted: with a meaningless number, or a scale that overflows float32."""
    return np.unique(np.concatenate([np.empty(0, np.intp), *_undrawable(model).values()]))


def drawable(model: Gaussians, source: str | Path) -> Gaussians:
    """Return a model as it is drawn: with the 3-D filter in its scales and opacities, and undrawable rows invisible.

    A planted row must not stop an audit, so undrawable rows only give a warning: the median of the column replaces
    their meaningless numbers, and their opacity becomes 0. A model without them and without a filter is returned
    unchanged.

    Raise `InputError` if no row can be drawn, or if the undrawable rows are anchors, whose opacity a network computes.
    """
    if not model.has_anchors:
        w, x, y, z = model.quats.T
        unturned = np.flatnonzero((w == 0) & (x == 0) & (y == 0) & (z == 0))
        if len(unturned):
            count = f"{len(unturned)} of {len(model)} rows"
            warn(f"{source}: {count} have a zero quaternion and are not drawn: {listed(unturned)}")
    undrawable = _undrawable(model)
    if not undrawable:
        return filtered(model)
    rows = undrawable_rows(model)
    if len(rows) == len(model) or model.has_anchors:
        name, bad_rows = next(iter(undrawable.items()))
        _refuse(model, source, name, bad_rows)
    warn(f"{source}: {len(rows)} of {len(model)} rows are not finite and are not drawn: {listed(rows)}")
    values = {name: model.columns(name)[:, 0] for name in ("opacity", *undrawable)}
    for name in undrawable.keys() - {"opacity"}:
        values[name][undrawable[name]] = np.median(np.delete(values[name], undrawable[name]))
    values["opacity"][rows] = NOTHING
    return filtered(model.with_columns(values))


def filtered(model: Gaussians) -> Gaussians:
    """Return a model with its filter applied to scales and opacities, and then set to 0.

    The filter adds its variance to that of each axis, and lowers the opacity by the ratio of the volumes. Programs that
    apply filters draw both models alike. A model without a filter is returned unchanged.
    """
    if FILTER not in model.names or not model.table[FILTER].any():
        return model
    sizes = model.columns(FILTER)[:, 0]
    rows = np.flatnonzero((sizes != 0) & (model.opacities > 0))
    log_scales = model.log_scales
    wider = widened(log_scales[rows], sizes[rows])
    volume_ratios = np.exp((log_scales[rows] - wider).sum(axis=1))
    log_scales[rows] = wider
    opacity_logits = model.columns("opacity")[:, 0]
    opacity_logits[rows] = logit(model.opacities[rows] * volume_ratios, LEAST_OPACITY)
    columns = {"opacity": opacity_logits, FILTER: np.zeros(len(model))}
    return model.with_columns(dict(zip(SCALES, log_scales.T, strict=True)) | columns)


def widened(log_scales: Float32, sizes: NDArray[Any]) -> Float64:
    """Return log(sqrt(s^2 + f^2)) of the scales s [K,3] of Gaussians and the standard deviations f [K] of filters."""
    variances = np.square(sizes, dtype=np.float64)[:, None]
    return np.asarray(np.logaddexp(2 * log_scales.astype(np.float64), np.log(variances)) / 2)


def require_finite(model: Gaussians, source: str | Path) -> None:
    """Refuse a model with a meaningless number in its stored geometry, opacity or colour."""
    for name, rows in non_finite_rows(model, _drawn_columns(model)).items():
        _refuse(model, source, name, rows)


def require_computed(outputs: Gaussians | Float32, source: str | Path, network: str) -> None:
    """Refuse the outputs of a network: numbers if any is not finite, Gaussians if more than half cannot be drawn.

    A few Gaussians may overflow because of rows that an attack added. These must not stop an audit: they are not drawn.
    """
    if isinstance(outputs, Gaussians):
        bad = len(undrawable_rows(outputs))
        most = len(outputs) // 2
        total = f"{len(outputs)} Gaussians"
    else:
        bad = int(np.count_nonzero(~np.isfinite(outputs)))
        most = 0
        total = f"{outputs.size} numbers"
    if bad > most:
        defect = f"infinity or not-a-number in {bad} of {total}"
        raise InputError(source, network, expected="finite results", found=defect, hint="network parameters too large?")


def _drawn_columns(model: Gaussians) -> list[str]:
    """Return the columns that an image depends on: geometry, opacity, filter, and colours or features."""
    colours = (*COLOUR, *model.columns_named("f_rest_"), *model.columns_named("semantic_"))
    return [*CORE, *(name for name in (*colours, FILTER) if name in model.names)]


def _undrawable(model: Gaussians) -> dict[str, Indices]:
    """Return the rows that cannot be drawn, for each column that prevents it."""
    undrawable = non_finite_rows(model, _drawn_columns(model))
    for name in SCALES:
        rows = np.flatnonzero(~(model.columns(name)[:, 0] <= _LARGEST_LOG_SCALE))
        if len(rows):
            undrawable[name] = rows
    return undrawable


def _refuse(model: Gaussians, source: str | Path, name: str, rows: Indices) -> None:
    defect = f"infinity or not-a-number in {len(rows)} of {len(model)} rows, first in row {rows[0]}"
    raise InputError(source, name, expected="finite numbers", found=defect, hint="`gspure info` counts them all")


def listed(rows: Sequence[int | str] | Indices) -> str:
    """Return the first rows, or names, as text."""
    text = ", ".join(map(str, rows[:_LISTED]))
    return f"{text}, ..." if len(rows) > _LISTED else text
