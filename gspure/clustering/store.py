"""The file ``clusters.npz``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gspure.artifacts import load_arrays, save_arrays
from gspure.clustering.selection import Labels
from gspure.constants import NOISE_LABEL
from gspure.errors import InputError


class Clusters(NamedTuple):
    """Labels [K], int32, and the number of coincident points (see `gspure.clustering.coincident_points`)."""

    labels: Labels
    coincident: int


def write_clusters(path: Path, clusters: Clusters, settings: Mapping[str, int | float | str]) -> None:
    """Write clusters, and the settings that made them, as .npz without pickle, whole or not at all."""
    entries = {"labels": clusters.labels, "coincident": np.array(clusters.coincident)}
    entries |= {name: np.array(value) for name, value in settings.items()}
    save_arrays(path, entries)


def read_clusters(path: Path) -> Clusters:
    """Read clusters.

    Raises
    ------
    InputError
        If the file is not one that `write_clusters` has written.

    """
    labels, coincident = load_arrays(path, ("labels", "coincident"), "clusters, as .npz").values()
    if labels.ndim != 1 or labels.dtype != np.int32 or labels.min(initial=NOISE_LABEL) < NOISE_LABEL:
        found = f"{labels.dtype} {list(labels.shape)}"
        raise InputError(path, "labels", expected=f"int32 [any], {NOISE_LABEL} or more", found=found)
    if coincident.ndim or coincident.dtype.kind != "i":
        raise InputError(path, "coincident", expected="a whole number", found=f"{coincident.dtype} {coincident.shape}")
    return Clusters(labels, int(coincident))
