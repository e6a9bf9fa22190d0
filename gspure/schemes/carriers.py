"""Redrawn twins: a public model whose carrier columns, which carry the message, are drawn again.

What a key still extracts from a twin comes from everything in the file but the message: it shows that the model
descends from the owner's, not that it holds the message (`gspure.metrics.proof`).
"""

from collections.abc import Sequence
from fnmatch import filter as matching

import numpy as np

from gspure.public_model import PublicModel


def permuted(public: PublicModel, carriers: Sequence[str], rng: np.random.Generator) -> PublicModel:
    """Return the model with the values of its carrier columns exchanged among rows; a row's values stay together.

    `carriers` are names, or patterns such as ``f_rest_*``.
    """
    table = public.model.table
    order = rng.permutation(len(table))
    names = [name for carrier in carriers for name in matching(public.model.names, carrier)]
    return public.with_model(public.model.with_columns({name: table[name][order] for name in names}))
