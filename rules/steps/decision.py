"""Select clusters from the tree, decide which rows to prune, and diagnose the clustering."""

from pathlib import Path
from typing import Any

import numpy as np

from gspure.arrays import load_array, save_array
from gspure.files import write_json
from gspure.method.clusters import select, write_clusters
from gspure.method.diagnosis import diagnose
from gspure.method.pruning import prune_mask
from gspure.method.tree import coincident_points, read_tree
from gspure.model import read_model
from gspure.model.summary import suspicious_rows
from gspure.provenance import write_provenance
from gspure.scan.verdict import judge
from gspure.workflow.step import run


def decide(model: Path, tree: Path, thresholded: Path, clusters: Path, mask: Path, diagnosis: Path, **how: Any) -> None:
    edges, factors = read_tree(tree), {name: how.pop(name) for name in ("tau_c", "tau_n")}
    labels, coincident = select(edges, **how), coincident_points(edges)
    write_clusters(clusters, labels, coincident, how)
    values = load_array(thresholded, dtype=np.float32, shape=(len(labels),), least=0)
    pruned, rows = prune_mask(labels, values, **factors), read_model(model)
    save_array(mask, pruned)
    diagnosed = diagnose(labels, values, **factors, coincident=coincident, quantity=thresholded.stem)
    suspicious = {reason: which.tolist() for reason, which in suspicious_rows(rows).items()}
    scan = {when: judge(each).word for when, each in {"before": rows, "after": rows[~pruned]}.items() if len(each)}
    write_json(diagnosis, diagnosed.to_json() | {"suspicious": suspicious, "scan": scan})
    inputs = {"model": model, "tree": tree, thresholded.stem: thresholded}
    write_provenance(mask.parent, "decision", inputs=inputs, settings=how | factors)


run(decide)
