"""Select clusters from the tree, decide which rows to prune, and diagnose the clustering."""

from pathlib import Path

from gspure.evaluation.deciding import DecisionFiles, decide
from gspure.method.settings import ClusterSettings, PruningFactors
from gspure.workflow.step import run


def select_and_prune(
    model: Path,
    tree: Path,
    thresholded: Path,
    selecting: ClusterSettings,
    factors: PruningFactors,
    clusters: Path,
    mask: Path,
    diagnosis: Path,
) -> None:
    decide(model, tree, thresholded, selecting, factors, DecisionFiles(clusters, mask, diagnosis))


run(select_and_prune)
