"""What people read is so: README, notebook and tutorial run; references are complete; the site builds and searches."""

import importlib.util
import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

import gspure
from gspure.attacks import BUILT_IN
from gspure.cameras import write_cameras
from gspure.cli import COMMANDS, main
from gspure.files import write_text
from gspure.model import read_model, write_model
from gspure.scenes import lighting
from gspure.workflow.schema import config_schema
from tests.documentation import PAGES, ROOT, blocks
from tests.test_purify import cameras, model
from tests.training_cases import colmap_project, ring

SPEC = importlib.util.spec_from_file_location("site_pages", ROOT / "setup" / "site.py")
site = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(site)

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
    _, *parts = re.split("^```(?:sh)?\n", (ROOT / "docs" / "tutorial.md").read_text(), flags=re.MULTILINE)
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
    assert all(f"## {attack.name}\n" in site.attacks_page() for attack in BUILT_IN)
    schema = config_schema()
    page = site.settings_page()
    assert all(f"## {name}\n" in page for name in schema["properties"])
    assert all(f"| `{name}` |" in page for name in schema["properties"]["method"]["properties"])


def test_a_step_of_the_history_that_is_a_tenth_slower_is_red(monkeypatch, tmp_path):
    rows = "day,at,on,image,audit\n1,a,x,1.00,1.00\n2,b,x,1.09,1.11\n"
    write_text(tmp_path / "benchmarks" / "history.csv", rows)
    monkeypatch.setattr(site, "ROOT", tmp_path)
    assert '| 1.09 | <span class="slower">1.11</span> |' in site.history()


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


README = ROOT / "README.md"
LINES = [line.partition("#")[0] for block in blocks(README, "sh") for line in block.splitlines()]
README_COMMANDS = [shlex.split(line)[1:] for line in LINES if line.startswith("gspure ")]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A user's folder with a model and its cameras, which is the current one."""
    write_model(tmp_path / "point_cloud.ply", model())
    write_cameras(tmp_path / "cameras.json", cameras())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_program_runs(folder):
    program, _ = blocks(README, "python")
    names = {}
    exec(program, names)  # noqa: S102
    assert names["image"].shape == (40, 48, 3)
    assert names["gradients"].means.shape == names["purified"].model.means.shape
    kept = ~names["purified"].prune_mask
    assert read_model(Path("purified.ply")).table.tobytes() == model().table[kept].tobytes()
    assert main(["purify", "point_cloud.ply", "--cameras", "cameras.json", "--out", "purified"]) == 0
    np.testing.assert_array_equal(np.load("purified/weights.npy"), names["purified"].weights)
    assert len(read_model(Path("purified"))) == np.count_nonzero(kept)


def test_tensors_of_gsplat_go_in_and_out(folder):
    torch = pytest.importorskip("torch", reason="gspure[torch] is not installed")
    tensors = {name: torch.from_numpy(array).requires_grad_() for name, array in model().to_gsplat().items()}
    torch.save({"step": 0, "splats": tensors}, "ckpt.pt")
    names = {"torch": torch, "gspure": gspure}
    exec(blocks(README, "python")[1], names)  # noqa: S102
    assert names["model"].table.tobytes() == model().table.tobytes()
    assert all(torch.equal(names["splats"][name], tensors[name]) for name in tensors)


def test_the_commands_run_one_after_the_other(folder, capsys, monkeypatch):
    quick = {
        "pair": ["--views", "8", "--width", "48", "--height", "36"],
        "embed": ["--set", "iterations=20"],
        "train": ["--iterations", "3"],
    }
    colmap_project(folder / "garden", ring(), np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3)))
    monkeypatch.setattr("gspure.cli.purify._draw", lambda *_: None)
    for arguments in README_COMMANDS:
        if arguments[0] not in {"audit", "demo"}:
            assert main([*arguments, *quick.get(arguments[0], [])]) == 0
    assert re.search(r"^renders +PSNR \d+\.\d dB, worst view \d+\.\d dB", capsys.readouterr().out, re.MULTILINE)
    assert np.load("purified/prune_mask.npy").any()
    assert len(read_model(Path("trained"))) == 20


@pytest.mark.workflow
def test_the_configuration_is_all_that_the_workflow_needs(folder):
    Path("mine.yaml").write_text(blocks(README, "yaml")[0])
    command = [sys.executable, "-m", "gspure", "audit", "mine.yaml", "--dry-run", "--cores", "1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    first, *jobs = done.stdout.splitlines()
    assert first == f"{sum(int(line.split()[0]) for line in jobs)} jobs to run; 0 up to date"
    assert {"     8  evaluate variant", "     1  write report"} <= {*jobs}
    assert not Path("results").exists()


NOTEBOOK = ROOT / "examples" / "audit_a_model.ipynb"
CELLS = [cell for cell in json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]


def drops(printed):
    """PSNR of scene and message after each attack."""
    lines = re.findall(r"(\w+) +scene +([\d.]+) dB +message +([\d.]+) dB", printed)
    return {name: (float(scene), float(message)) for name, scene, message in lines}


def test_every_cell_of_the_notebook_runs_and_is_stored_with_its_results(tmp_path, monkeypatch, capsys):
    outputs = [output for cell in CELLS for output in cell["outputs"]]
    assert all(cell["execution_count"] for cell in CELLS)
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 2
    monkeypatch.chdir(tmp_path)
    mpl.use("agg")
    names = {}
    for cell in CELLS:
        exec("".join(cell["source"]), names)  # noqa: S102
    after = drops(capsys.readouterr().out)
    assert after["GSPure"][0] > after["random"][0] + 5
    assert after["GSPure"][1] < after["random"][1]
    stored = drops("".join(line for output in CELLS[-1]["outputs"] for line in output["text"]))
    assert after["GSPure"] == pytest.approx(stored["GSPure"], abs=1)
