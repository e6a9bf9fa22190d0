"""Wall and CPU time of several variants, measured in turn so that all are subject to the same noise."""

from __future__ import annotations

import os
import platform
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

CORES = len(os.sched_getaffinity(0))

Variants = Mapping[str, Callable[[], object]]
Measure = Callable[..., dict[str, "Times"]]
"""The fixture `measure` (conftest.py): ``measure(variants, rounds=, warm_ups=1)``."""


@dataclass
class Times:
    """Seconds of each run: on the clock, and of CPU time (user and system, all threads of this process)."""

    wall: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)

    def measure(self, run: Callable[[], object]) -> None:
        """Run once, and add the times."""
        wall = time.perf_counter()
        cpu = time.process_time()
        run()
        self.wall.append(time.perf_counter() - wall)
        self.cpu.append(time.process_time() - cpu)

    @property
    def per_core(self) -> list[float]:
        """CPU time over the cores: the wall time on an idle machine if its cores shared all of the work."""
        return [seconds / CORES for seconds in self.cpu]

    def __add__(self, addend: Times) -> Times:
        """Return the sums of both times, round by round."""
        return Times(np.add(self.wall, addend.wall).tolist(), np.add(self.cpu, addend.cpu).tolist())

    def __truediv__(self, divisor: Times) -> float:
        """Return the ratio of both CPU times: the median over the rounds."""
        return float(np.median(np.divide(self.cpu, divisor.cpu)))


def one_round(variants: Variants, times: Mapping[str, Times]) -> None:
    """Measure every variant once, in order."""
    for name, run in variants.items():
        times[name].measure(run)


def processor() -> str:
    """Return the name of the processor, and its widest vectors."""
    listing = Path("/proc/cpuinfo")
    if not listing.exists():
        return platform.processor() or platform.machine()
    fields = dict(re.findall(r"^([^\t:]+?)\s*: (.*)$", listing.read_text(encoding="utf-8"), re.MULTILINE))
    widest = next((f for f in ("avx512f", "avx2", "avx") if f in fields.get("flags", "").split()), "no AVX")
    model = fields.get("model name", platform.machine())
    return f"{model}, family {fields.get('cpu family', '?')}, model {fields.get('model', '?')}, {widest}"
