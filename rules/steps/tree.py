"""Standardize position, opacity and weight of every row, and span HDBSCAN's tree over them."""

from pathlib import Path

import numpy as np

from gspure.files import load_array, save_array
from gspure.method.features import features as standardized
from gspure.method.features import take
from gspure.method.tree import spanning_tree
from gspure.schemes.registry import read_public_model
from gspure.workflow.step import run


def span(
    model: Path,
    weights: Path,
    opacities: Path,
    features: Path,
    tree: Path,
    cluster_on: list[str],
    min_samples: int,
    scheme: str | None,
) -> None:
    rows = read_public_model(model, scheme).drawable(model).model
    per_row = [load_array(path, dtype=np.float32, shape=(len(rows),), least=0) for path in (opacities, weights)]
    table = standardized(rows.means, *per_row)
    save_array(features, table)
    save_array(tree, spanning_tree(take(table, cluster_on), min_samples))


run(span)
