"""Pruning by rank: what has the lowest value goes first."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.attacks.attack import Mask


def lowest_mask(values: NDArray[Any], removed: int) -> Mask:
    """Return a mask [K] that is false at exactly the `removed` lowest of `values` [K]; of equals, the first go."""
    kept = np.ones(len(values), np.bool_)
    kept[np.argsort(values, kind="stable")[:removed]] = False
    return kept
