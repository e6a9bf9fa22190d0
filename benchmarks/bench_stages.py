"""The stages of a frame with image and contributions, and the share of the processor's peak that blending reaches."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks import peak
from benchmarks.evals import FLOPS_PER_EVAL, count_evals
from benchmarks.findings import Findings
from benchmarks.room import SMALL, Scene, each_scene
from benchmarks.stages import Stages
from benchmarks.timing import Measure
from gspure.constants import Energy
from gspure.opencl.engine import Engine
from gspure.opencl.frame import Traversal

TRAVERSAL = Traversal("ewa", channels=3, sh_degree=3, contributions=True)


@pytest.mark.parametrize("energy", ["ewa", "ray"])
@each_scene
def test_stages(scene: Scene, energy: Energy, engine: Engine, measure: Measure, findings: Findings) -> None:
    stages = Stages(engine, scene.model, scene.camera, replace(TRAVERSAL, energy=energy))
    times = measure(
        {
            "project": stages.project,
            "sort by depth": stages.sort,
            "bin": stages.bin,
            "blend without contributions": partial(stages.blend, contributions=False),
            "blend": stages.blend,
            "sum contributions": stages.sum,
        },
        rounds=scene.rounds,
    )
    preparing = times["project"] + times["sort by depth"] + times["bin"]
    blending = times["blend without contributions"]
    alone = preparing + blending
    whole = preparing + times["blend"] + times["sum contributions"]

    findings.figure("visible Gaussians", stages.order.visible)
    findings.figure("tile entries", stages.entries())
    findings.figure("frame with contributions, wall, ms", 1e3 * np.median(whole.wall), at_most=scene.frame_ms)
    findings.figure("the same, CPU / cores, ms", 1e3 * np.median(whole.per_core), at_most=scene.frame_ms)
    findings.figure("frame with / without contributions", whole / alone, at_most=1.25)
    findings.figure("blend with / without contributions", times["blend"] / blending, at_most=1.12)
    findings.figure("(sort + bin) / blend", (times["sort by depth"] + times["bin"]) / blending, at_most=0.45)
    findings.figure("project / blend", times["project"] / blending, at_most=0.2)


@each_scene
def test_blending_against_the_peak(
    scene: Scene, engine: Engine, measure: Measure, findings: Findings, tmp_path: Path
) -> None:
    """The share of the processor's peak of multiply-adds that evaluates splats."""
    if engine.style == "gpu":
        pytest.skip("the native peak is a processor's")
    stages = Stages(engine, scene.model, scene.camera, replace(TRAVERSAL, contributions=False))
    for stage in (stages.project, stages.sort, stages.bin):
        stage()
    width = peak.lanes(engine)
    peaks = {"FMA, OpenCL": peak.opencl(engine, width), "FMA, native": peak.native(width, tmp_path)}
    runs = {name: run for name, run in peaks.items() if run}
    times = measure({"blend": stages.blend, **runs}, rounds=scene.rounds)

    evals = count_evals(stages)
    findings.figure("floats in a vector", width)
    findings.figure("evaluations per pixel", evals / (scene.width * scene.height))
    findings.figure("blend, 10^9 evaluations per second", 1e-9 * evals / np.median(times["blend"].per_core))
    for name in runs:
        findings.figure(f"{name}, GFLOP/s", 1e-9 * peak.flops(width) / np.median(times[name].per_core))
        share = FLOPS_PER_EVAL * evals / peak.flops(width) * (times[name] / times["blend"])
        findings.figure(f"blend, share of {name}", share, at_least=scene.peak_share)
        assert float(share) < 1, "blending cannot do more than the processor can: the peak is wrong"


def test_styles(engine: Engine, measure: Measure, findings: Findings) -> None:
    """The two kernel styles on one device: on a processor, barriers cost most of the time."""
    variants = {}
    for style in ("cpu", "gpu"):
        stages = Stages(Engine(engine.device, style), SMALL.model, SMALL.camera, TRAVERSAL)
        stages.project()
        stages.sort()
        stages.bin()
        variants[f"blend, {style} style"] = stages.blend
    times = measure(variants, rounds=3)
    ratio = times["blend, gpu style"] / times["blend, cpu style"]
    findings.figure("gpu / cpu style", ratio, at_least=20.0 if engine.style == "cpu" else None)
