"""Rows whose properties are not quite those of 3DGS: number types, two scales, colours as red, green and blue."""

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.constants import SH_DC
from gspure.files import Float64
from gspure.model.gaussians import COLOUR, CORE, SCALES, Gaussians

_RGB: Final = ("red", "green", "blue")
_THIN: Final = 1e-3  # the third axis of a flat Gaussian, as a share of its shorter one; ours
_FINE: Final = 1 / 200  # largest step of coordinates in float32, as a share of the median Gaussian; ours


def offset_comment(offset: Float64) -> str:
    """Return the comment of a model that lies around `offset` [3]."""
    return "gspure offset " + " ".join(map(str, offset.tolist()))


@np.errstate(over="ignore", invalid="ignore")  # infinities are found where models are made drawable
def converted(rows: NDArray[np.void]) -> tuple[NDArray[np.void], list[str], tuple[str, ...]]:
    """Return rows [K] with 3DGS's properties, float32 as far as images depend on them; what was changed; a comment.

    Rows that have these are returned as they are. Those without scales or opacity are no Gaussians, and stay so. If
    float32 would round coordinates of more digits, they become relative to an offset, which the comment names.
    """
    columns: dict[str, NDArray[Any]] = {name: rows[name] for name in rows.dtype.names or ()}
    changes: list[str] = []
    comments: tuple[str, ...] = ()
    if {*_RGB, "opacity"} <= columns.keys() and "f_dc_0" not in columns:
        shades = zip(COLOUR, (columns.pop(name) for name in _RGB), strict=True)
        columns |= {name: (_unit(shade) - 0.5) / np.float32(SH_DC) for name, shade in shades}
        changes.append(f"colours {', '.join(_RGB)} become f_dc_0..2")
    if {"scale_0", "scale_1"} <= columns.keys() and "scale_2" not in columns:
        columns["scale_2"] = np.minimum(columns["scale_0"], columns["scale_1"]) + np.float32(math.log(_THIN))
        changes.append(f"flat Gaussians (2DGS) get scale_2, {_THIN:g} of their shorter axis")
    numbered = Gaussians(rows[:0]).columns_named("f_rest_")
    drawn = [name for name in (*CORE, *COLOUR, *numbered) if name in columns]
    if others := sorted({str(columns[name].dtype) for name in drawn} - {"float32"}):
        changes.append(f"properties of type {', '.join(others)} become float32")
    if not changes:
        return rows, [], ()
    if (offset := _offset(columns)).any():
        columns |= {name: columns[name] - start for name, start in zip("xyz", offset, strict=True)}
        comments = (offset_comment(offset),)
        changes.append(f"coordinates become relative to {' '.join(map(str, offset.tolist()))}, and cameras too")
    table = np.empty(len(rows), [(name, "<f4" if name in drawn else column.dtype) for name, column in columns.items()])
    for name, column in columns.items():
        table[name] = column
    return table, changes, comments


def _offset(columns: Mapping[str, NDArray[Any]]) -> Float64:
    """Return the median centre, rounded, if float32 is too coarse for coordinates there that are float64, else 0."""
    scales = [columns[name] for name in SCALES if name in columns]
    if not scales or not {*"xyz"} <= columns.keys() or np.float64 not in [columns[name].dtype for name in "xyz"]:
        return np.zeros(3)
    means = np.column_stack([columns[name] for name in "xyz"])
    rows = np.isfinite(means).all(axis=1)
    if not rows.any():
        return np.zeros(3)
    centre, size = np.round(np.median(means[rows], axis=0)), np.exp(np.median(np.max(scales, axis=0)[rows]))
    return centre if np.spacing(np.abs(centre).max().astype(np.float32)) > _FINE * size else np.zeros(3)


def _unit(shades: NDArray[Any]) -> NDArray[np.float32]:
    """Return colours from 0 to 1 of stored ones: in the range of an unsigned type, else to 255 if any is above 1."""
    if shades.dtype.kind == "u":
        return np.asarray(shades / np.float32(np.iinfo(shades.dtype).max), np.float32)
    return np.asarray(shades / np.float32(255 if (shades > 1).any() else 1), np.float32)
