"""The harness: every benchmark gets `findings` to fill; all of them are shown at the end, and kept on request.

pytest benchmarks --record           # writes benchmarks/results.json and benchmarks/results.md
pytest benchmarks --record avx2      # the same of another kind of processor: results-avx2.json and .md

With POCL_LLVM_CPU_NAME=haswell POCL_KERNELLIB_NAME=avx2, PoCL compiles for AVX2 on other processors too.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from findings import Findings
from machine import describe
from pytest_benchmark.fixture import BenchmarkFixture
from timing import Measure, Times, Variants, one_round

from gspure.files import write_json, write_text
from gspure.opencl.device import choose_device
from gspure.opencl.engine import Engine

HERE = Path(__file__).parent
FOUND = pytest.StashKey[list[Findings]]()
MACHINE = pytest.StashKey[dict[str, str]]()

EXPLANATION = """\
Times are in milliseconds: medians over the runs, and the least. Variants of one table ran in turn. *CPU / cores* is the
CPU time of all threads over the number of cores: on a free machine it is the wall time of whatever the cores share, and
unlike wall time it hardly changes while other programs run. Ratios are of CPU time, round by round."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--record", nargs="?", const="", metavar="KIND", help="write benchmarks/results[-KIND].json and .md"
    )


def pytest_configure(config: pytest.Config) -> None:
    # Compiled kernels are kept where the tests keep theirs; PoCL reads this when it is loaded.
    os.environ.setdefault("POCL_CACHE_DIR", str(HERE.parent / ".pytest_cache" / "pocl"))
    config.stash[FOUND] = []
    config.stash[MACHINE] = describe(choose_device())


@pytest.fixture(scope="session")
def engine() -> Engine:
    """The device that gspure would choose."""
    return Engine(choose_device().cl_device)


@pytest.fixture
def findings(request: pytest.FixtureRequest) -> Findings:
    """What this benchmark finds, under the test's name."""
    title = request.node.name.removeprefix("test_").replace("_", " ").replace("[", " [")
    request.config.stash[FOUND].append(found := Findings(title))
    return found


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
    found = [findings for findings in config.stash[FOUND] if findings.times or findings.figures]
    if not found:
        return
    text = report(config.stash[MACHINE], found)
    terminalreporter.write_line(f"\n{text}")
    if (kind := config.getoption("--record")) is not None:
        page = HERE / "-".join(filter(None, ("results", kind)))
        tables = [findings.summary() for findings in found]
        write_json(page.with_suffix(".json"), {"machine": config.stash[MACHINE], "found": tables})
        write_text(page.with_suffix(".md"), text)


def report(machine: dict[str, str], found: list[Findings]) -> str:
    """Return all findings as Markdown."""
    kind = "\n".join(f"| {name} | {value} |" for name, value in machine.items())
    tables = "\n".join(line for findings in found for line in findings.markdown())
    return f"# Benchmarks\n\n| machine | |\n|---|---|\n{kind}\n\n{EXPLANATION}\n\n{tables}"
