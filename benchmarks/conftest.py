"""The harness: every benchmark gets `findings` to fill; all are shown at the end, and recorded on request.

pytest benchmarks --record           # writes benchmarks/results.json
pytest benchmarks --record gpu       # writes results-gpu.json, for another kind of processor

With POCL_LLVM_CPU_NAME=haswell POCL_KERNELLIB_NAME=avx2, PoCL compiles for AVX2 on other processors too.
"""

import os
import platform
from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.findings import Findings
from benchmarks.timing import CORES, Measure, Times, Variants, one_round, processor
from gspure.files import write_json
from gspure.opencl.device import Device, choose_device
from gspure.opencl.engine import Engine

HERE = Path(__file__).parent
FINDINGS = pytest.StashKey[list[Findings]]()
MACHINE = pytest.StashKey[dict[str, str]]()

EXPLANATION = """\
Times are in milliseconds: medians over the runs, and the least. Variants of one table ran in turn. *CPU / cores* is the
CPU time of all threads over the number of cores: the wall time of work that all cores of an idle machine share. Unlike
wall time, it hardly changes while other programs run. Ratios are of CPU time, round by round."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--record", nargs="?", const="", metavar="KIND", help="write benchmarks/results[-KIND].json")


def pytest_configure(config: pytest.Config) -> None:
    # Compiled kernels are kept where the tests keep theirs; PoCL reads this when it is loaded.
    os.environ.setdefault("POCL_CACHE_DIR", str(HERE.parent / ".pytest_cache" / "pocl"))
    config.stash[FINDINGS] = []
    config.stash[MACHINE] = describe(choose_device())


@pytest.fixture(scope="session")
def engine() -> Engine:
    """An engine of the device that gspure chooses."""
    return Engine(choose_device().cl_device)


@pytest.fixture
def findings(request: pytest.FixtureRequest) -> Findings:
    """The findings of this benchmark, under the test's name."""
    title = request.node.name.removeprefix("test_").replace("_", " ").replace("[", " [")
    empty = Findings(title)
    request.config.stash[FINDINGS].append(empty)
    return empty


@pytest.fixture
def measure(benchmark: BenchmarkFixture, findings: Findings) -> Measure:
    """Measure variants in turn, `rounds` times after `warm_ups`; add the times to the findings and return them."""

    def run(variants: Variants, *, rounds: int, warm_ups: int = 1) -> dict[str, Times]:
        for _ in range(warm_ups):
            one_round(variants, {name: Times() for name in variants})
        times = {name: Times() for name in variants}
        benchmark.pedantic(one_round, args=(variants, times), rounds=rounds)
        findings.times |= times
        benchmark.extra_info["times_ms"] = findings.summary()["times_ms"]
        return times

    return run


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    filled = [findings for findings in config.stash[FINDINGS] if findings.times or findings.figures]
    if not filled:
        return
    terminalreporter.write_line("\n" + report(config.stash[MACHINE], filled))
    kind = config.getoption("--record")
    if kind is not None:
        name = f"results-{kind}.json" if kind else "results.json"
        tables = [findings.summary() for findings in filled]
        write_json(HERE / name, {"machine": config.stash[MACHINE], "found": tables})


def report(machine: dict[str, str], filled: list[Findings]) -> str:
    """Return the machine and all findings as Markdown."""
    properties = "\n".join(f"| {name} | {value} |" for name, value in machine.items())
    tables = "\n".join(line for findings in filled for line in findings.markdown())
    return f"# Benchmarks\n\n| machine | |\n|---|---|\n{properties}\n\n{EXPLANATION}\n\n{tables}"


def describe(device: Device) -> dict[str, str]:
    """Return the properties of the machine that the results depend on."""
    target = os.environ.get("POCL_LLVM_CPU_NAME")
    return {
        "processor": processor(),
        "cores": str(CORES),
        "memory": f"{os.sysconf('SC_PHYS_PAGES') * os.sysconf('SC_PAGE_SIZE') / 2**30:.0f} GiB",
        "load before": f"{os.getloadavg()[0]:.1f}",
        "OpenCL device": device.name,
        "OpenCL driver": f"{device.platform} {device.driver}",
        "kernels compiled for": f"{target}, but run on the processor above" if target else "this processor",
        "software": f"{platform.system()}, Python {platform.python_version()}, numpy {np.__version__}",
    }
