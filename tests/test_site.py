"""The documentation site: its tutorial runs, its references are complete, and it builds without warnings."""

import importlib.util
import re
import shlex
import subprocess
import sys

import pytest

import gspure
from gspure.cli import COMMANDS, main
from gspure.scenes import lighting
from gspure.workflow.schema import config_schema
from tests.documentation import PAGES, ROOT

SPEC = importlib.util.spec_from_file_location("site_pages", ROOT / "setup" / "site.py")
site = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(site)

TUTORIAL = ROOT / "docs" / "tutorial.md"
SMALLER = {
    "gspure pair": " --width 48 --height 36",
    "gspure embed": " --set iterations=30 --set max_gaussians=600",
    "gspure audit marked/public": " -- --dry-run",  # minutes: its jobs are only planned
}
"""What is appended to commands of the tutorial, so that it takes seconds; all else is as there."""


def test_the_tutorial_runs_and_writes_the_files_that_it_names(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, value in {"NODE_SPACING": 0.5, "DIRECTIONS": 4, "LAMP_SAMPLES": 2}.items():
        monkeypatch.setattr(lighting, name, value)  # light maps that are quick to bake
    _, *parts = re.split("^```(?:sh)?\n", TUTORIAL.read_text(), flags=re.MULTILINE)
    for commands, text in zip(parts[::2], parts[1::2], strict=True):
        for line in commands.splitlines():
            smaller = line + next((more for start, more in SMALLER.items() if line.startswith(start)), "")
            if line.startswith(("cp", "gspure audit")):
                subprocess.run(smaller.replace("gspure", f"{sys.executable} -m gspure", 1), shell=True, check=True)  # noqa: S602
            else:
                assert main(shlex.split(smaller)[1:]) == 0, line
        for name in re.findall(r"`([\w/]+\.\w+)`", text):
            assert [*tmp_path.rglob(name)], name
    assert (tmp_path / "audit-marked-small-1" / "results" / "audit.yaml").is_file()


def test_the_references_name_everything():
    assert all(f"::: gspure.{name}\n" in site.python_page() for name in gspure.__all__ if name != "__version__")
    assert all(f"## gspure {name}\n" in site.commands_page() for name in COMMANDS)
    schema = config_schema()
    page = site.settings_page()
    assert all(f"## {name}\n" in page for name in schema["properties"])
    assert all(f"| `{name}` |" in page for name in schema["properties"]["method"]["properties"])


@pytest.mark.parametrize("name", site.CLASSES)
def test_the_classes_of_the_reference_exist(name):
    module, _, attribute = name.rpartition(".")
    assert getattr(importlib.import_module(module), attribute).__doc__


def test_every_page_is_in_the_navigation():
    text = (ROOT / "mkdocs.yml").read_text()
    places = {site.OUTSIDE.get(str(page.relative_to(ROOT)), page.name) for page in PAGES}
    assert [place for place in sorted(places) if f": {place}\n" not in text] == []


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The folder of the site, built without warnings."""
    pytest.importorskip("mkdocs", reason="gspure[docs] is not installed")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


def test_formulas_need_no_script(built):
    assert "<math" in (built / "method.html").read_text()


@pytest.mark.parametrize("width", [1400, 900, 420])
def test_the_search_works_from_disk(built, visit, width):
    page = visit(built / "index.html", width)
    if width < 1000:
        page.locator("label[for=__search].md-header__button").click()
    page.locator(".md-search__input").click()
    page.locator(".md-search__input").press_sequentially("opacity")
    page.locator(".md-search-result__item").nth(3).wait_for()
    page.locator(".md-search-result__link").first.click()
    page.wait_for_url(lambda url: "index.html" not in url)
    page.goto((built / "leaderboard.html").as_uri())
    assert "Robust radius" in page.content() or "robust radius" in page.content()
    assert page.evaluate("() => document.documentElement.scrollWidth <= innerWidth")
