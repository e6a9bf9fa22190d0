"""The attack of several customers, who compare their copies of one model, each with another mark."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Indices
from gspure.attacks.attack import Rng, named
from gspure.attacks.attacked import Attacked, NotApplicable, require
from gspure.errors import InputError
from gspure.model import read_model
from gspure.model.gaussians import Gaussians, Table

NONE: Final = "none"
RULES: Final = ("mean", "interleave", "majority")


def collusion(model: Gaussians, rng: Rng, *, copies: str = NONE, rule: str = RULES[0]) -> Attacked:
    """Mix the model with all .ply files below the folder `copies`: the same rows with other marks.

    By `rule`, each stored number becomes the ``mean`` over the copies, or their median, which is the value of the
    ``majority`` if a mark has two values. Or each row comes from a random copy (``interleave``).

    Source: ours.
    """
    require("collusion", "rule", rule, f"one of {', '.join(RULES)}", fits=rule in RULES)
    files = [] if copies == NONE else sorted(Path(copies).rglob("*.ply"))
    if not files:
        raise NotApplicable("collusion", f"no .ply file of another copy: copies={copies}")
    tables = [model.table, *(_table(file, model) for file in files)]
    chosen = rng.integers(len(tables), size=len(model))
    values = {}
    for name in model.names:
        columns = [table[name] for table in tables]
        if any((column != columns[0]).any() for column in columns):
            values[name] = _mixed(columns, rule, chosen)
    return Attacked.changed(model, values)


def _table(file: Path, model: Gaussians) -> Table:
    """Return the rows of a copy, or refuse it if it has others than the model."""
    copy = read_model(file)
    if len(copy) != len(model) or not {*model.names} <= {*copy.names}:
        expected = f"{len(model)} rows with the columns of the model"
        raise InputError(file, "copy", expected=expected, found=f"{len(copy)} rows with {len(copy.names)} columns")
    return copy.table


def _mixed(columns: Sequence[NDArray[Any]], rule: str, chosen: Indices) -> NDArray[Any]:
    """Return one column [K] from those of the copies; `chosen` [K] is the copy of each row."""
    values = np.stack(columns)
    if rule == "interleave":
        return np.asarray(values[chosen, np.arange(len(chosen))])
    middle = np.mean if rule == "mean" else np.median
    return np.asarray(middle(values.astype(np.float64), axis=0))


ATTACKS = named({collusion: None})
