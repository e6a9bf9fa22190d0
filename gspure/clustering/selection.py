"""Flat clusters out of a spanning tree: single linkage, condensing, stability, selection."""

from __future__ import annotations

from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from gspure.constants import MAX_CLUSTER_SHARE, MIN_CLUSTER_SIZE, NOISE_LABEL
from gspure.errors import InputError

Labels = NDArray[np.int32]
Selection = Literal["eom_capped", "eom", "leaf"]
SELECTIONS: Final[tuple[Selection, ...]] = get_args(Selection)


def select(
    tree: NDArray[np.float64],
    min_cluster_size: int = MIN_CLUSTER_SIZE,
    selection: Selection = "eom_capped",
    max_cluster_share: float = MAX_CLUSTER_SHARE,
) -> Labels:
    r"""Return the flat clustering :math:`\mathcal{C} = \{C_1, ..., C_M\} \cup \mathcal{N}` of a spanning tree.

    (paper, §Geometrically Accurate Feature Clustering; hdbscan's own functions.) The paper names neither parameters
    nor selection. ``eom`` is excess of mass, HDBSCAN's default, which often keeps most of a scene as one cluster;
    ``eom_capped`` splits clusters above `max_cluster_share`; ``leaf`` takes the finest clusters.

    Parameters
    ----------
    tree : array [K-1,3]
        Edges (a, b, distance), sorted by distance: see `spanning_tree`.
    min_cluster_size : int
        Smallest cluster, at least 2. With fewer than twice as many points there are no two clusters to tell apart, and
        all is noise.
    selection : {"eom_capped", "eom", "leaf"}
        How clusters are chosen from the hierarchy.
    max_cluster_share : float
        For ``eom_capped``: largest share of the points in one cluster, in (0, 1]; what cannot be split below it is
        noise. Twice `min_cluster_size` is always allowed, so that small models have clusters at all.

    Returns
    -------
    array [K], int32
        Cluster of each point, 0 .. M-1; -1 is noise.

    Raises
    ------
    InputError
        If a setting is out of range.

    """
    _check(min_cluster_size, selection, max_cluster_share)
    count = len(tree) + 1
    if count < 2 * min_cluster_size:
        return np.full(count, NOISE_LABEL, np.int32)

    from hdbscan._hdbscan_linkage import label
    from hdbscan._hdbscan_tree import compute_stability, condense_tree, get_clusters

    condensed = condense_tree(label(tree), min_cluster_size)
    capped = selection == "eom_capped"
    labels, _, _ = get_clusters(
        condensed,
        compute_stability(condensed),
        cluster_selection_method="leaf" if selection == "leaf" else "eom",
        max_cluster_size=max(int(max_cluster_share * count), 2 * min_cluster_size) if capped else 0,
    )
    return np.asarray(labels, np.int32)


def _check(min_cluster_size: int, selection: str, max_cluster_share: float) -> None:
    if min_cluster_size < 2:
        raise InputError("clustering", "min_cluster_size", expected="at least 2", found=str(min_cluster_size))
    if selection not in SELECTIONS:
        raise InputError("clustering", "selection", expected=f"one of {', '.join(SELECTIONS)}", found=repr(selection))
    if not 0 < max_cluster_share <= 1:
        raise InputError("clustering", "max_cluster_share", expected="in (0, 1]", found=str(max_cluster_share))
