"""Evidence that a model holds a message of bits: the majority of what a detector reads from its views."""

from collections.abc import Sequence
from math import comb
from typing import NamedTuple

from gspure.metrics.readings import Reading


class BitEvidence(NamedTuple):
    """How many bits the views agree on, and how probable as many are by chance."""

    p: float  # at least 2^-bits, or by rank among keys
    correct: int
    bits: int
    views: int


def bit_evidence(readings: Sequence[Reading], message: str) -> BitEvidence:
    r"""Return the evidence of readings for an embedded message, a text of 0 and 1.

    Each bit is that of the majority of the views; a tie counts as wrong. Of n random bits, k or more are correct with
    the probability

    .. math:: p = 2^{-n} \sum_{i=k}^{n} \binom{n}{i},

    computed in whole numbers. A single reading that knows how it ranks among other keys has that p-value instead.
    """
    n = len(message)
    columns = zip(*(reading.decoded for reading in readings), strict=True)
    votes = [column.count(bit) for column, bit in zip(columns, message, strict=True)]
    correct = sum(2 * count > len(readings) for count in votes)
    ways = sum(comb(n, i) for i in range(correct, n + 1))
    ranks = [reading.p for reading in readings if reading.p is not None]
    return BitEvidence(ranks[0] if len(ranks) == 1 else ways / 2**n, correct, n, len(readings))
