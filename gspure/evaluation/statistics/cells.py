"""Results by scene and seed, brought into the shape of the statistics: one array per scene, of its seeds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gspure.errors import InputError

Cells = Mapping[tuple[str, int], float]
"""A number for every (scene, seed)."""

Groups = list[NDArray[np.float64]]


def by_scene(cells: Cells) -> Groups:
    """Return the cells as one array per scene, of all its seeds; scenes and seeds in sorted order."""
    scenes: dict[str, list[float]] = {}
    for scene, seed in sorted(cells):
        scenes.setdefault(scene, []).append(cells[scene, seed])
    return [np.array(values, np.float64) for values in scenes.values()]


def differences(a: Cells, b: Cells) -> Groups:
    """Return ``a - b`` in every cell that both have, as one array per scene."""
    return by_scene({cell: a[cell] - b[cell] for cell in a.keys() & b.keys()})


def checked(values: Sequence[ArrayLike]) -> Groups:
    """Return the values in an order that does not depend on how scenes and seeds were listed.

    Equal data then gives equal bits, whatever the resampling draws.

    Raises
    ------
    InputError
        If there is no scene, a scene has no value, or a value is not finite.

    """
    groups = [np.sort(np.asarray(group, np.float64).ravel()) for group in values]
    if not groups or not all(group.size for group in groups):
        raise InputError("statistics", "values", expected="at least one per scene", found=f"{list(map(len, groups))}")
    if not all(np.isfinite(group).all() for group in groups):
        raise InputError("statistics", "values", expected="finite numbers", found=f"{[g.tolist() for g in groups]}")
    return sorted(groups, key=lambda group: (group.mean(), *group))
