"""Standardize position, opacity and weight of every row, and span HDBSCAN's tree over them."""

from pathlib import Path
from typing import Any

import numpy as np

from gspure.arrays import load_array, save_array
from gspure.method.features import joint_features, take
from gspure.method.tree import spanning_tree
from gspure.schemes.registry import read_public_model
from gspure.workflow.step import run


def span(model: Path, weights: Path, opacities: Path, features: Path, tree: Path, **how: Any) -> None:
    rows = read_public_model(model, how["scheme"]).drawable(model).model
    per_row = [load_array(path, dtype=np.float32, shape=(len(rows),), least=0) for path in (opacities, weights)]
    table = joint_features(rows.means, *per_row)
    save_array(features, table)
    save_array(tree, spanning_tree(take(table, how["cluster_on"]), how["min_samples"]))


run(span)
