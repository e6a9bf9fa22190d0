"""How cost grows with Gaussians, pixels and views."""

import shutil
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.bench_clustering import scene
from benchmarks.findings import Findings
from benchmarks.room import LARGE, camera, panning, room
from benchmarks.timing import Measure, Times
from gspure.method.clusters import select
from gspure.method.contributions import contribute
from gspure.method.tree import spanning_tree
from gspure.public_model import PublicModel
from gspure.renderer import Renderer

COUNTS = (50_000, 200_000, 1_000_000, 3_000_000, 6_000_000)
WIDTHS = (400, 800, 1600, 3200)
VIEWS = (1, 10, 100)


def per_million(times: Mapping[str, Times], counts: Iterable[int], findings: Findings, unit: str) -> None:
    """Add the CPU seconds of each variant per million of what grows."""
    for (name, measured), count in zip(times.items(), counts, strict=True):
        findings.figure(f"{name}: CPU seconds per million {unit}", 1e6 / count * np.median(measured.cpu))


def test_contributions_with_gaussians(measure: Measure, findings: Findings) -> None:
    view = camera(LARGE.width, LARGE.height)
    renderers = {f"{count:,} Gaussians": Renderer(room(count), energy="ray") for count in COUNTS}
    views = {name: partial(renderer.contributions, view) for name, renderer in renderers.items()}
    per_million(measure(views, rounds=5), COUNTS, findings, "Gaussians")


def test_clustering_with_gaussians(measure: Measure, findings: Findings) -> None:
    def cluster(count: int) -> None:
        select(spanning_tree(scene(count)), 50, "eom_capped")

    cluster(1000)  # builds the kernels
    runs: dict[str, Callable[[], object]] = {f"{count:,} Gaussians": partial(cluster, count) for count in COUNTS}
    per_million(measure(runs, rounds=1, warm_ups=0), COUNTS, findings, "Gaussians")


def test_contributions_with_pixels(measure: Measure, findings: Findings) -> None:
    renderer = Renderer(LARGE.model, energy="ray")
    cameras = [camera(width, round(width * LARGE.height / LARGE.width)) for width in WIDTHS]
    views = {f"{view.width} x {view.height} px": partial(renderer.contributions, view) for view in cameras}
    times = measure(views, rounds=7)
    per_million(times, [view.width * view.height for view in cameras], findings, "pixels")


def test_contributions_with_views(measure: Measure, findings: Findings, tmp_path: Path) -> None:
    """Views of one model, stored, beside as many views of a renderer alone."""
    public = PublicModel(LARGE.model)
    cameras = panning(max(VIEWS), LARGE.width, LARGE.height)
    renderer = Renderer(LARGE.model, energy="ray")

    def store(views: int) -> None:
        folder = tmp_path / str(views)
        contribute(public, cameras[:views], folder)
        shutil.rmtree(folder)

    def render(views: int) -> None:
        for view in cameras[:views]:
            renderer.contributions(view)

    render(1)
    runs: dict[str, Callable[[], object]] = {f"{views} views, stored": partial(store, views) for views in VIEWS}
    runs["100 passes alone"] = partial(render, 100)
    times = measure(runs, rounds=1, warm_ups=0)
    ratio = times["100 views, stored"] / times["100 passes alone"]
    findings.figure("100 views, stored / 100 passes alone", ratio, at_most=1.1)
