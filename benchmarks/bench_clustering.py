"""The spanning tree and the selection, on features with the tails of a real scene."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from benchmarks.findings import Findings
from benchmarks.timing import Measure
from gspure.constants import MIN_SAMPLES
from gspure.method.clusters import SELECTIONS, select
from gspure.method.features import joint_features
from gspure.method.tree import hdbscan_tree, spanning_tree

ORACLE = 200_000
"""Most points of which hdbscan computes the tree too, in a minute of CPU time."""


def scene(count: int) -> np.ndarray:
    """Features [K,5]: surfaces, far background, floaters, opacities of two humps, lognormal weights, some zero."""
    rng = np.random.default_rng(0)
    kinds = rng.choice(4, count, p=[0.35, 0.5, 0.11, 0.04])  # ground, objects, background, floaters
    centres = rng.uniform(-5, 5, (40, 3))
    ground = np.column_stack([rng.uniform(-8, 8, (count, 2)), rng.normal(0, 0.01, count)])
    objects = centres[rng.integers(0, 40, count)] + rng.normal(0, 0.3, (count, 3))
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    background = directions * np.minimum(10 * (1 + rng.pareto(1.5, count)), 400)[:, None]
    floaters = rng.uniform(-10, 10, (count, 3))
    means = np.choose(kinds[:, None], [ground, objects, background, floaters])
    opacities = np.where(rng.random(count) < 0.6, rng.beta(8, 1, count), rng.beta(1, 8, count))
    weights = rng.lognormal(0, 2, count) * (rng.random(count) > 0.05)
    return joint_features(means, opacities, weights)


@pytest.fixture(scope="module", params=[50_000, 200_000, 1_000_000], ids=["50k", "200k", "1M"])
def points(request: pytest.FixtureRequest) -> np.ndarray:
    return scene(request.param)


@pytest.fixture(scope="module")
def tree(points: np.ndarray) -> np.ndarray:
    return spanning_tree(points)


def test_spanning_tree(points: np.ndarray, measure: Measure, findings: Findings) -> None:
    spanning_tree(points[:100])  # builds the kernels
    variants: dict[str, Callable[[], object]] = {"spanning tree": partial(spanning_tree, points)}
    if len(points) <= ORACLE:
        ones = np.ones(len(points), int)
        variants["by hdbscan"] = partial(hdbscan_tree, points, ones, MIN_SAMPLES)
    times = measure(variants, rounds=1, warm_ups=0)
    if "by hdbscan" in times:
        findings.figure("by hdbscan / spanning tree", times["by hdbscan"] / times["spanning tree"])
    findings.figure("CPU seconds per million", 1e6 / len(points) * times["spanning tree"].cpu[0], at_most=9.0)


def test_selection(tree: np.ndarray, measure: Measure) -> None:
    measure({f"selection, {rule}": partial(select, tree, 50, rule) for rule in SELECTIONS}, rounds=3)
