"""The decision of GSPure as the workflow makes it: clusters, prune mask and diagnosis, from files of earlier steps."""

from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gspure.arrays import Bools, load_array, save_array
from gspure.files import Json, write_json
from gspure.method.clusters import select, write_clusters
from gspure.method.diagnosis import Diagnosis, diagnose
from gspure.method.pruning import prune_mask
from gspure.method.settings import ClusterSettings, PruningFactors
from gspure.method.tree import coincident_points, read_tree
from gspure.model import Gaussians, model_file, read_model
from gspure.model.summary import suspicious_rows
from gspure.provenance import bind_rows, write_provenance
from gspure.scan.verdict import judge


class DecisionFiles(NamedTuple):
    """What a decision writes, in the folder of its model."""

    clusters: Path
    prune_mask: Path
    diagnosis: Path


def decide(
    model: Path,
    tree: Path,
    thresholded: Path,
    selecting: ClusterSettings,
    factors: PruningFactors,
    out: DecisionFiles,
) -> None:
    """Select clusters from a tree, decide by weights or opacities which rows of a model to prune, and diagnose both."""
    edges = read_tree(tree)
    labels = select(edges, **asdict(selecting))
    coincident = coincident_points(edges)
    write_clusters(out.clusters, labels, coincident, asdict(selecting))
    values = load_array(thresholded, dtype=np.float32, shape=(len(labels),), least=0)
    pruned = prune_mask(labels, values, **asdict(factors))
    save_array(out.prune_mask, pruned)
    bind_rows(model_file(model), out.clusters, out.prune_mask)
    diagnosis = diagnose(labels, values, **asdict(factors), coincident=coincident, quantity=thresholded.stem)
    write_json(out.diagnosis, diagnosis_record(diagnosis, read_model(model), pruned))
    inputs = {"model": model, "tree": tree, thresholded.stem: thresholded}
    settings = asdict(selecting) | asdict(factors)
    write_provenance(out.prune_mask.parent, "decision", inputs=inputs, settings=settings)


def diagnosis_record(diagnosis: Diagnosis, model: Gaussians, pruned: Bools) -> Json:
    """Return the content of ``diagnosis.json`` for a model with K rows, of which a mask [K] prunes some."""
    suspicious = {reason: rows.tolist() for reason, rows in suspicious_rows(model).items()}
    scanned = {"before": model, "after": model[~pruned]}
    scan = {when: judge(rows).word for when, rows in scanned.items() if len(rows)}
    return diagnosis.to_json() | {"suspicious": suspicious, "scan": scan}
