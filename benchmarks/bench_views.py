"""Whole views of `gspure.renderer`."""

from functools import partial

import numpy as np

from benchmarks.findings import Findings
from benchmarks.room import Scene, each_scene
from benchmarks.timing import Measure
from gspure.renderer import Renderer


@each_scene
def test_views(scene: Scene, measure: Measure, findings: Findings) -> None:
    splats = Renderer(scene.model, energy="ewa")
    by_ray = Renderer(scene.model, energy="ray")
    camera = scene.camera
    features = np.random.default_rng(0).random((scene.count, 16), np.float32)
    times = measure(
        {
            "image (ewa)": partial(splats.image, camera),
            "contributions (ewa)": partial(splats.contributions, camera),
            "image (ray)": partial(by_ray.image, camera),
            "contributions (ray)": partial(by_ray.contributions, camera),
            "median depth (ray)": partial(by_ray.depth, camera),
            "feature map, 16 channels (ewa)": partial(splats.feature_map, camera, features),
        },
        rounds=scene.rounds,
    )
    for energy in ("ewa", "ray"):
        ratio = times[f"contributions ({energy})"] / times[f"image ({energy})"]
        findings.figure(f"contributions / image ({energy})", ratio, at_most=1.25)
    rays = times["contributions (ray)"] / times["contributions (ewa)"]
    findings.figure("contributions (ray) / contributions (ewa)", rays, at_most=1.15)
    frame = times["contributions (ewa)"]
    findings.figure("contributions (ewa), wall, ms", 1e3 * np.median(frame.wall), at_most=scene.frame_ms)
    findings.figure("contributions (ewa), CPU / cores, ms", 1e3 * np.median(frame.per_core), at_most=scene.frame_ms)
