"""Agreement of a pruning with the rows that are known to carry a message."""

from typing import Final, NamedTuple

import numpy as np

from gspure.files import Bools

MESSAGE_ROWS: Final = "message_rows.npy"  # file of a key, of schemes that know which rows carry the message: bool [K]


class Recall(NamedTuple):
    """Precision and recall of a pruning; NaN for a division by zero."""

    precision: float  # share of the pruned rows that carry the message
    recall: float  # share of the rows that carry the message that are pruned


def recall(pruned: Bools, truth: Bools) -> Recall:
    """Return precision and recall of a pruning; `pruned` and `truth`, the rows that carry the message, are bool [K]."""
    hits = int(np.count_nonzero(pruned & truth))
    return Recall(_ratio(hits, int(pruned.sum())), _ratio(hits, int(truth.sum())))


def _ratio(part: int, whole: int) -> float:
    return part / whole if whole else float("nan")
