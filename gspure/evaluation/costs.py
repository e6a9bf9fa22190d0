"""The cost of attacks, averaged over scenes."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from gspure.cost import cost_of, read_cost
from gspure.evaluation.intervals import scene_means
from gspure.evaluation.matched import Sweeps
from gspure.evaluation.outcomes import Outcome, by_condition

Kind = Literal["variant", "sweep"]


class AttackCost(NamedTuple):
    """The mean cost of one variant, or of all variants of a sweep, over the scenes and seeds of one condition."""

    scheme: str
    protocol: str
    initialization: str
    kind: Kind  # a sweep may have the name of one of its variants
    attack: str
    cpu: float  # CPU time of the attack and all measurements that it needs, without the search for its strength, s
    memory: float  # peak memory, with the search, MiB


def attack_costs(outcomes: Sequence[Outcome], sweeps: Sweeps, folder: Path) -> list[AttackCost]:
    """Return the costs that `gspure attack` has written to ``SCHEME/SCENE/VARIANT/attack.cost.json`` in a folder."""
    rows = []
    for condition, alike in by_condition(outcomes).items():
        groups: dict[tuple[Kind, str], Sequence[str]] = {("variant", o.variant): [o.variant] for o in alike}
        groups |= {("sweep", name): variants for name, variants in sweeps.items()}
        for (kind, name), variants in groups.items():
            files = [
                (o.scene, cost_of(folder / o.scheme / o.folder / o.variant / "attack"))
                for o in alike
                if o.variant in variants
            ]
            costs = {(scene, i): read_cost(file) for i, (scene, file) in enumerate(files) if file.is_file()}
            if costs:
                mean = np.mean([*scene_means(costs).values()], axis=0)
                rows.append(AttackCost(*condition, kind, name, *mean.tolist()))
    return rows
