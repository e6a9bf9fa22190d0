"""Rows whose numbers are no numbers."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gspure.errors import InputError
from gspure.model.gaussians import COLOUR, CORE, Gaussians


def non_finite_rows(model: Gaussians, names: Iterable[str]) -> dict[str, NDArray[np.intp]]:
    """Return the rows that hold an infinity or a not-a-number, for each of the named columns that has any."""
    found: dict[str, list[NDArray[np.intp]]] = {name: [] for name in names}
    for rows, block in model.blocks():
        for name, parts in found.items():
            finite = np.isfinite(block[name])
            if not finite.all():
                parts.append(rows.start + np.flatnonzero(~finite))
    return {name: np.concatenate(parts) for name, parts in found.items() if parts}


def require_finite(model: Gaussians, source: str | Path) -> None:
    """Check what a model is rendered and clustered from: geometry, opacity and colour, as stored.

    Raises
    ------
    InputError
        Naming the first property at fault, in how many rows it is, and the first of them (counted from 0).

    """
    colour = (*COLOUR, *model.columns_named("f_rest_")) if model.sh_degree >= 0 else ()
    for name, rows in non_finite_rows(model, (*CORE, *colour)).items():
        found = f"infinity or not-a-number in {len(rows)} of {len(model)} rows, first in row {rows[0]}"
        raise InputError(source, name, expected="finite numbers", found=found, hint="`gspure info` counts them all")
