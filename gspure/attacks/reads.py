"""Whether an attack affected the columns that a message is read from.

If it did not, the survival of the message says nothing about robustness; the paper's own tables hold such rows.
"""

from collections.abc import Sequence
from fnmatch import filter as matching

from gspure.attacks.attack import Attacked
from gspure.errors import InputError
from gspure.model.gaussians import Gaussians


def affected(before: Gaussians, after: Attacked, reads: Sequence[str]) -> bool:
    """Return whether an attack removed a row of the public model or changed a bit of the columns `reads`.

    These are names, or patterns such as ``f_rest_*``; if there are none, only removed rows count. Order does not count.
    Added rows count where they differ from the row they were copied from: an extraction that blends all rows reads
    their positions; one that finds its rows by position ignores others.

    Raise `InputError` if a pattern matches no column of the public model.
    """
    for pattern in reads:
        if not matching(before.names, pattern):
            raise InputError("extraction", pattern, expected="columns of the public model", found="none of this name")
    names = {name for pattern in reads for name in matching(before.names, pattern)}
    return bool(after.prune_mask.any()) or any(
        name not in after.model.names or before.table[name][after.rows].tobytes() != after.model.table[name].tobytes()
        for name in names
    )
