"""Redrawn twins: a public model whose carrier columns, which carry the message, are drawn again.

What a key still extracts from a twin comes from everything in the file but the message: it shows that the model
descends from the owner's, not that it holds the message (`gspure.metrics.proof`).
"""

from collections.abc import Sequence
from fnmatch import filter as matching
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Indices
from gspure.public_model import PublicModel


def permuted(public: PublicModel, carriers: Sequence[str], rng: np.random.Generator) -> PublicModel:
    """Return the model with the values of its carrier columns exchanged among rows; a row's values stay together.

    `carriers` are names, or patterns such as ``f_rest_*``.
    """
    order = rng.permutation(len(public.model))
    return public.with_model(public.model.with_columns(_values(public, carriers, order)))


def transplanted(marked: PublicModel, onto: PublicModel, carriers: Sequence[str]) -> PublicModel:
    """Return a model whose rows have the values that the nearest rows of a marked model have in its carriers."""
    from scipy.spatial import KDTree

    _, nearest = KDTree(marked.model.means).query(onto.model.means)
    return marked.with_model(onto.model.with_columns(_values(marked, carriers, nearest)))


def _values(public: PublicModel, carriers: Sequence[str], rows: Indices) -> dict[str, NDArray[Any]]:
    """Return the values of some rows in the carrier columns."""
    names = [name for carrier in carriers for name in matching(public.model.names, carrier)]
    return {name: public.model.table[name][rows] for name in names}
