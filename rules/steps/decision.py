"""Select clusters from the tree, decide which rows to prune, and diagnose the clustering."""

from pathlib import Path
from typing import Any

import numpy as np

from gspure.files import load_array, save_array, write_json, write_provenance
from gspure.method.clusters import Clusters, Selection, select, write_clusters
from gspure.method.diagnosis import diagnose
from gspure.method.pruning import prune_mask
from gspure.method.tree import coincident_points, read_tree
from gspure.model import read_model
from gspure.model.summary import suspicious_rows, to_json
from gspure.workflow.step import run


def decide(
    model: Path,
    tree: Path,
    weights: Path,
    clusters: Path,
    mask: Path,
    diagnosis: Path,
    min_cluster_size: int,
    selection: Selection,
    max_cluster_share: float,
    tau_c: float,
    tau_n: float,
) -> None:
    edges = read_tree(tree)
    how: dict[str, Any] = {
        "min_cluster_size": min_cluster_size,
        "selection": selection,
        "max_cluster_share": max_cluster_share,
    }
    labels, coincident = select(edges, **how), coincident_points(edges)
    write_clusters(clusters, Clusters(labels, coincident), how)
    omega = load_array(
        weights, dtype=np.float32, shape=(len(labels),), least=0
    )  # opacities, if clusters ignore weights
    save_array(mask, prune_mask(labels, omega, tau_c, tau_n))
    found = diagnose(labels, omega, tau_c, tau_n, coincident, weights.stem)
    write_json(diagnosis, found.to_json() | {"suspicious": to_json(suspicious_rows(read_model(model)))})
    inputs, settings = {"model": model, "tree": tree, "weights": weights}, how | {"tau_c": tau_c, "tau_n": tau_n}
    write_provenance(mask.parent, "decision", inputs=inputs, settings=settings)


run(decide)
