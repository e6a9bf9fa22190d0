"""The rigid transform of an attack that moves the model, as ``gspure attack --transform`` writes it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gspure.artifacts import load_array
from gspure.cameras.camera import Float64
from gspure.cameras.entry import Entry


def read_transform(path: Path) -> Float64:
    """Read a rigid transform [4,4].

    Raises
    ------
    InputError
        If the file is missing or damaged, or the matrix is not rigid.

    """
    matrix = load_array(path, dtype=np.float64, shape=(4, 4))
    entry = Entry(path, "", {"array": matrix.tolist()})
    transform = entry.array("array", (4, 4))
    entry.rotation("array", transform[:3, :3])
    if transform[3].tolist() != [0, 0, 0, 1]:
        raise entry.refusal("array", expected="0 0 0 1 in the last row", found=" ".join(map(str, transform[3])))
    return transform
