"""Exact HDBSCAN in two steps: an expensive spanning tree, and a cheap selection of clusters from it."""

from gspure.method.clustering.diagnosis import Diagnosis, diagnose
from gspure.method.clustering.selection import SELECTIONS, Selection, select
from gspure.method.clustering.store import Clusters, read_clusters, read_tree, write_clusters
from gspure.method.clustering.tree import coincident_points, spanning_tree

__all__ = [
    "SELECTIONS",
    "Clusters",
    "Diagnosis",
    "Selection",
    "coincident_points",
    "diagnose",
    "read_clusters",
    "read_tree",
    "select",
    "spanning_tree",
    "write_clusters",
]
