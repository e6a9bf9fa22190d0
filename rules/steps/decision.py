"""Select clusters from the tree, decide which rows to prune, and diagnose the clustering."""

from pathlib import Path
from typing import Any

import numpy as np

from gspure.files import load_array, save_array, write_json, write_provenance
from gspure.method.clusters import select, write_clusters
from gspure.method.diagnosis import diagnose
from gspure.method.pruning import prune_mask
from gspure.method.tree import coincident_points, read_tree
from gspure.model import read_model
from gspure.model.summary import suspicious_rows
from gspure.workflow.step import run


def decide(model: Path, tree: Path, thresholded: Path, clusters: Path, mask: Path, diagnosis: Path, **how: Any) -> None:
    edges, factors = read_tree(tree), {name: how.pop(name) for name in ("tau_c", "tau_n")}
    labels, coincident = select(edges, **how), coincident_points(edges)
    write_clusters(clusters, labels, coincident, how)
    values = load_array(thresholded, dtype=np.float32, shape=(len(labels),), least=0)
    save_array(mask, prune_mask(labels, values, **factors))
    diagnosed = diagnose(labels, values, **factors, coincident=coincident, quantity=thresholded.stem)
    suspicious = {reason: rows.tolist() for reason, rows in suspicious_rows(read_model(model)).items()}
    write_json(diagnosis, diagnosed.to_json() | {"suspicious": suspicious})
    inputs = {"model": model, "tree": tree, thresholded.stem: thresholded}
    write_provenance(mask.parent, "decision", inputs=inputs, settings=how | factors)


run(decide)
