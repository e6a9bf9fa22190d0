"""Select clusters from the tree, decide which rows to prune, and diagnose the clustering."""

from dataclasses import asdict
from pathlib import Path

import numpy as np

from gspure.arrays import load_array, save_array
from gspure.evaluation.diagnosing import diagnosis_record
from gspure.files import write_json
from gspure.method.clusters import select, write_clusters
from gspure.method.diagnosis import diagnose
from gspure.method.pruning import prune_mask
from gspure.method.settings import ClusterSettings, PruningFactors
from gspure.method.tree import coincident_points, read_tree
from gspure.model import read_model
from gspure.provenance import write_provenance
from gspure.workflow.step import run


def decide(
    model: Path,
    tree: Path,
    thresholded: Path,
    selecting: ClusterSettings,
    factors: PruningFactors,
    clusters: Path,
    mask: Path,
    diagnosis: Path,
) -> None:
    edges = read_tree(tree)
    labels = select(edges, **asdict(selecting))
    coincident = coincident_points(edges)
    write_clusters(clusters, labels, coincident, asdict(selecting))
    values = load_array(thresholded, dtype=np.float32, shape=(len(labels),), least=0)
    pruned = prune_mask(labels, values, **asdict(factors))
    save_array(mask, pruned)
    diagnosed = diagnose(labels, values, **asdict(factors), coincident=coincident, quantity=thresholded.stem)
    write_json(diagnosis, diagnosis_record(diagnosed, read_model(model), pruned))
    inputs = {"model": model, "tree": tree, thresholded.stem: thresholded}
    write_provenance(mask.parent, "decision", inputs=inputs, settings=asdict(selecting) | asdict(factors))


run(decide)
