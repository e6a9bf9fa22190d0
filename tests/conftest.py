"""Fixtures that several test files share: each OpenCL device that works here, kernel style, energy."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import hypothesis
import pytest

from gspure import progress
from gspure.files import write_text
from tests.plugin_path import register

if TYPE_CHECKING:
    from types import SimpleNamespace

    from playwright.sync_api import Browser, ConsoleMessage, Page, Request

    from gspure.schemes.pair import Pair

# Every run takes the same examples, in any time; HYPOTHESIS_PROFILE=search looks for new ones.
hypothesis.settings.register_profile("patient", deadline=None, derandomize=True)
hypothesis.settings.register_profile("search", deadline=None, max_examples=1000)
hypothesis.settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "patient"))

register()

SLOWEST = (
    "test_workflow",
    "test_site",
    "test_device",
    "test_adapter",
    "test_browser",
    "test_schemes",
    "test_reference_run",
)

# Read when PoCL and PyTorch are loaded. Of several test processes, each has its own cache of kernels, and one thread.
_WORKER = os.environ.get("PYTEST_XDIST_WORKER", "")
os.environ.setdefault("POCL_CACHE_DIR", str(Path(__file__).parents[1] / ".pytest_cache" / "pocl" / _WORKER))
if _WORKER:
    os.environ.setdefault("POCL_MAX_PTHREAD_COUNT", "1")
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # of PyTorch


SNAKEMAKE = """
import json, os, pathlib, signal, subprocess, sys, time
pipe = os.open(os.environ["GSPURE_EVENTS"], os.O_WRONLY)
def send(**event):
    os.write(pipe, (json.dumps(event) + "\\n").encode())
"""
"""The beginning of a program that takes the place of Snakemake."""


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run a test with the argument `device` on each of them; none are looked for when no test asks."""
    if "device" in metafunc.fixturenames:
        from gspure.opencl.device import list_devices, works

        devices = [device for device in list_devices() if works(device)]
        metafunc.parametrize("device", devices, ids=[f"device{device.index}" for device in devices], scope="session")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files whose tests take longest: no process waits for them in the end."""
    items.sort(key=lambda item: item.path.stem not in SLOWEST)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """List what was skipped, for ``pytest @.pytest_cache/skipped`` when more packages are installed."""
    skipped = {report.nodeid for report in terminalreporter.stats.get("skipped", [])}
    path = terminalreporter.config.rootpath / ".pytest_cache" / "skipped"
    write_text(path, "".join(f"{test}\n" for test in sorted(skipped)))


def pytest_runtest_setup() -> None:
    """Forget the `--quiet` of an earlier test."""
    progress.quiet = False


@pytest.fixture(scope="session", autouse=True)
def storage_order_of_large_models() -> Iterator[None]:
    """Small models are stored along the curve, too."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gspure.opencl.storage.FEW", 0)
        yield


@pytest.fixture(params=["cpu", "gpu"])
def style(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(params=["ewa", "ray"])
def energy(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def asset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a model of 30 Gaussians and nine cameras; it is the current one."""
    from gspure.cameras import write_cameras
    from gspure.model import write_model
    from tests.models import blobs, camera

    write_model(tmp_path / "model.ply", blobs(30))
    write_cameras(tmp_path / "cameras.json", [camera(40, 30, name=f"view_{i}") for i in range(9)])
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def snakemake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], int]:
    """Return a function that writes the program which takes the place of Snakemake; its folder is the current one."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    package = tmp_path / "fake" / "snakemake"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    monkeypatch.setenv("PYTHONPATH", str(package.parent), prepend=os.pathsep)
    return lambda program: (package / "__main__.py").write_text(SNAKEMAKE + program)


@pytest.fixture(scope="session")
def pair_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ray-traced pair of 12 small views."""
    from tests.scheme_cases import small_pair

    return small_pair(tmp_path_factory.mktemp("pair"))


@pytest.fixture(scope="session")
def pair(pair_folder: Path) -> Pair:
    from gspure.schemes.pair import read_pair

    return read_pair(pair_folder)


@pytest.fixture(scope="session")
def own_pair_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same pair with the message at poses of its own."""
    from tests.scheme_cases import small_pair

    return small_pair(tmp_path_factory.mktemp("own_pair"), protocol="own")


@pytest.fixture(scope="session")
def trained(pair_folder: Path) -> Callable[[str], SimpleNamespace]:
    """Return a function from a scheme's name to what it embeds in the shared pair (`tests.scheme_cases`)."""
    from tests.scheme_cases import embedded_in

    return cache(partial(embedded_in, pair_folder))


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Chromium without a window; it draws WebGL on the CPU."""
    from playwright.sync_api import sync_playwright

    names = ("chromium", "chromium-browser", "google-chrome")
    installed = [path for path in map(shutil.which, names) if path]
    if not installed:
        pytest.skip(f"none of {', '.join(names)} is installed (setup/browser.sh)")
    with sync_playwright() as playwright:
        drawing = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        browser = playwright.chromium.launch(executable_path=installed[0], args=drawing)
        yield browser
        browser.close()


@pytest.fixture
def visit(browser: Browser) -> Iterator[Callable[..., Page]]:
    """Return a function from a file and a width to its page; errors and requests to the network fail the test."""
    problems: list[str] = []

    def note_error(message: ConsoleMessage) -> None:
        if message.type == "error":
            problems.append(message.text)

    def note_request(request: Request) -> None:
        if not request.url.startswith(("file:", "data:", "blob:")):
            problems.append(request.url)

    context = browser.new_context()
    context.set_default_timeout(10_000)
    context.on("console", note_error)
    context.on("weberror", lambda error: problems.append(str(error.error)))
    context.on("request", note_request)

    def visited(file: Path, width: int = 1400) -> Page:
        page = context.new_page()
        page.set_viewport_size({"width": width, "height": 900})
        page.goto(file.as_uri())
        return page

    yield visited
    context.close()
    assert problems == []
