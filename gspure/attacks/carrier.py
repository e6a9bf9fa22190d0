"""Whether an attack touched what a message is stored in at all.

A message that an attack did not reach says nothing about how robust it is: the paper's own tables hold such rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import filter as matching

from gspure.attacks.attack import Attacked
from gspure.errors import InputError
from gspure.model.gaussians import Gaussians


def reached(before: Gaussians, after: Attacked, carrier: Sequence[str]) -> bool:
    """Return whether an attack lost a row of the public model, or left another bit in its carrier.

    Order is not looked at, and further rows count only where they differ from what they were copied from: an extraction
    that blends all rows has their positions in its carrier, one that knows its rows is not touched by others.

    Parameters
    ----------
    before : Gaussians
        The public model.
    after : Attacked
        What an attack left of it.
    carrier : sequence of str
        The columns that the message is read from: names, or patterns such as ``f_rest_*``. None: only lost rows matter.

    Raises
    ------
    InputError
        A pattern fits no column of the public model.

    """
    columns = before.table.dtype.names or ()
    for pattern in carrier:
        if not matching(columns, pattern):
            raise InputError("carrier", pattern, expected="columns of the public model", found="none of this name")
    left = after.model.table.dtype.names or ()
    names = {name for pattern in carrier for name in matching(columns, pattern)}
    return not after.kept.all() or any(
        name not in left or before.table[name][after.rows].tobytes() != after.model.table[name].tobytes()
        for name in names
    )
