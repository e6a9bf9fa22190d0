"""The benchmarks replace a function of the kernels to count evaluations; they must keep its signature."""

from pathlib import Path

import pytest

from gspure.opencl.device import Device
from gspure.opencl.engine import Engine
from gspure.opencl.frame import Traversal


def test_the_benchmark_counts_at_least_one_evaluation_per_covered_pixel(
    monkeypatch: pytest.MonkeyPatch, device: Device
) -> None:
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "benchmarks")
    from evals import count_evals
    from room import camera, room
    from stages import Stages

    engine = Engine(device.cl_device)
    stages = Stages(engine, room(2000), camera(80, 60), Traversal("ewa", channels=3, sh_degree=3, contributions=False))
    for stage in (stages.project, stages.sort, stages.bin):
        stage()
    assert count_evals(stages) >= 80 * 60 // 2
