"""Numbers by scene and seed, grouped by scene."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from gspure.dtypes import Float64
from gspure.errors import InputError

Cells = Mapping[tuple[str, int], float]
"""A number for every (scene, seed)."""

Groups = list[Float64]


def by_scene(cells: Cells) -> Groups:
    """Return one array per scene with the values of its seeds; scenes and seeds in sorted order."""
    scenes: dict[str, list[float]] = {}
    for scene, seed in sorted(cells):
        scenes.setdefault(scene, []).append(cells[scene, seed])
    return [np.array(values, np.float64) for values in scenes.values()]


def differences(a: Cells, b: Cells) -> Groups:
    """Return ``a - b`` for the cells of both, as one array per scene."""
    return by_scene({cell: a[cell] - b[cell] for cell in a.keys() & b.keys()})


def checked(values: Sequence[ArrayLike]) -> Groups:
    """Return the values in a canonical order, so that equal data gives equal bits in any order of scenes and seeds.

    Raise `InputError` if there is no scene, a scene has no value, or a value is not finite.
    """
    groups = [np.sort(np.asarray(group, np.float64).ravel()) for group in values]
    if not groups or not all(group.size for group in groups):
        raise InputError("statistics", "values", expected="at least one per scene", found=f"{list(map(len, groups))}")
    if not all(np.isfinite(group).all() for group in groups):
        raise InputError("statistics", "values", expected="finite numbers", found=f"{[g.tolist() for g in groups]}")
    return sorted(groups, key=lambda group: (group.mean(), *group))
