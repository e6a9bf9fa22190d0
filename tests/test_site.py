"""The documentation site: its tutorial runs, its references are complete, and it builds without warnings."""

import importlib.util
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import gspure
from gspure.cli import COMMANDS, main
from gspure.scenes import lighting
from gspure.workflow.schema import config_schema
from tests.documentation import PAGES, ROOT, blocks

SPEC = importlib.util.spec_from_file_location("site_pages", ROOT / "setup" / "site.py")
site = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(site)


def test_the_commands_of_the_tutorial_run_one_after_the_other(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, value in {"NODE_SPACING": 0.5, "DIRECTIONS": 4, "LAMP_SAMPLES": 2}.items():
        monkeypatch.setattr(lighting, name, value)  # light maps that are quick to bake
    smaller = {"pair": ["--width", "48", "--height", "36"], "embed": ["--set", "max_gaussians=600"]}
    lines = [line for block in blocks(ROOT / "docs" / "tutorial.md", "sh") for line in block.splitlines()]
    lines = [line.replace("iterations=600", "iterations=30") for line in lines]
    for program, *arguments in map(shlex.split, lines):
        if program == "cp":
            shutil.copy(*arguments)
        elif program == "mkdir":
            Path(*arguments).mkdir()
        elif program == "cd":
            monkeypatch.chdir(*arguments)
        elif arguments[0] == "audit":
            command = [sys.executable, "-m", "gspure", *arguments, "--dry-run"]
            assert subprocess.run(command, capture_output=True, check=False).returncode == 0
        else:
            assert main([*arguments, *smaller.get(arguments[0], [])]) == 0, arguments
    assert {path.name for path in (tmp_path / "purified" / "figures").glob("*.png")} >= {"kept.png", "weights.png"}


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
