"""Standardize position, opacity and weight of every row, and span HDBSCAN's tree over them."""

from pathlib import Path

import numpy as np

from gspure.arrays import load_array, save_array
from gspure.method.features import joint_features, take
from gspure.method.settings import Feature
from gspure.method.tree import spanning_tree
from gspure.schemes.registry import read_public_model
from gspure.workflow.step import run


def span(
    model: Path,
    weights: Path,
    opacities: Path,
    features: Path,
    tree: Path,
    cluster_on: tuple[Feature, ...],
    min_samples: int,
    scheme: str | None,
) -> None:
    rows = read_public_model(model, scheme).drawable(model).model
    shape = (len(rows),)
    alpha = load_array(opacities, dtype=np.float32, shape=shape, least=0)
    omega = load_array(weights, dtype=np.float32, shape=shape, least=0)
    joint = joint_features(rows.means, alpha, omega)
    save_array(features, joint)
    save_array(tree, spanning_tree(take(joint, cluster_on), min_samples))


run(span)
