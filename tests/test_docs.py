"""The documentation agrees with the code: links, constants, functions, diagrams, the example of a package."""

import importlib
import pkgutil
import re
from operator import attrgetter

import numpy as np
import pytest
import yaml

import gspure
from gspure import constants
from gspure.attacks import Measurements, attacks
from gspure.attacks.registry import BUILT_IN
from tests.documentation import PAGES, ROOT, blocks, edges, install_example, workflow_edges
from tests.models import blobs
from tests.workflow_cases import settled

DOCS = ROOT / "docs"


def anchors(page):
    """Return the anchors that GitHub gives to a page's headings."""
    titles = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_have_targets(page):
    for target in re.findall(r"\]\((?!https?:)([^)]+)\)", page.read_text(encoding="utf-8")):
        file, _, anchor = target.partition("#")
        linked = (page.parent / file).resolve() if file else page
        assert linked.exists(), target
        assert not anchor or anchor in anchors(linked), target


def test_numerics_names_every_constant_of_the_renderer_and_the_method():
    text = (DOCS / "numerics.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([A-Z][A-Z0-9_]+)`", text)) - {"FOOTPRINT_MARGIN"}  # a kernel's own
    assert named == {name for name in vars(constants) if name.isupper()} - {"MAX_SH_DEGREE", "NOISE_LABEL"}


def test_functions_that_the_method_page_names_exist():
    table = re.findall(r"^\| [PO] \|.*\| (.*) \|$", (DOCS / "method.md").read_text(encoding="utf-8"), re.MULTILINE)
    names = [
        name for cell in table for name in re.findall(r"`([a-z_.]+\.[A-Za-z_.]+)`", cell) if not name.endswith(".cl")
    ]
    assert len(names) > 10
    modules = {module.name for module in pkgutil.walk_packages(gspure.__path__, "gspure.")}
    for name in names:
        module = max((m for m in modules if f"gspure.{name}".startswith(f"{m}.")), key=len)
        attrgetter(f"gspure.{name}".removeprefix(f"{module}."))(importlib.import_module(module))


def test_the_page_of_attacks_lists_the_built_in_ones_with_their_settings():
    section = (DOCS / "attacks.md").read_text(encoding="utf-8").partition("## ")[0]
    listed = re.findall(r"^\| `(\w+)` \|.*\|(.*)\|[ \w]*\|$", section, re.MULTILINE)
    shown = {name: dict(setting.split("=") for setting in re.findall(r"`(\S+)`", cell)) for name, cell in listed}
    settings = {a.name: {name: str(default) for name, default in a.settings.items()} for a in BUILT_IN}
    assert list(shown.items()) == list(settings.items())


@pytest.mark.workflow
def test_arrows_of_the_diagram_are_arrows_of_the_workflow(tmp_path):
    (diagram,) = blocks(DOCS / "architecture.md", "mermaid")
    assert edges(diagram) <= workflow_edges(tmp_path)


@pytest.fixture
def plugged_in(tmp_path, monkeypatch):
    """The example of the guide, installed as a package of its own; returns the example's configuration."""
    install_example(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return yaml.safe_load(blocks(DOCS / "extending.md", "yaml")[0])


def test_the_example_attack_is_registered_and_works(plugged_in):
    model, weights = blobs(40), np.arange(40, dtype=np.float32)[::-1].copy()
    attack = attacks()["faint_pruning"]
    assert attack.needs == {"weights"}
    attacked = attack.apply(model, Measurements(weights=weights), share=0.5)
    assert attacked.prune_mask.tolist() == [False] * 20 + [True] * 20
    assert attacked.model.table.tobytes() == model.table[:20].tobytes()


def test_the_example_configuration_is_valid(plugged_in):
    config = settled(plugged_in)
    assert config["variants"]["faint_half"] == {"attack": "faint_pruning", "share": 0.5, "seed": 1}
    assert config["variants"]["faint_pruning"]["attack"] == "faint_pruning"
    assert config["schemes"]["faint_splats"] == {"iterations": 1500, "seed": 0}
