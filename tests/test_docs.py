"""The documentation agrees with the code: links, constants, functions, diagrams, the example of a package."""

import csv
import importlib
import re
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest
import yaml

from gspure import constants
from gspure.attacks import BUILT_IN, Measurements, attacks
from gspure.evaluation.results import read_results
from gspure.evaluation.survival import Survival
from gspure.metrics.comparison import ViewMetrics
from gspure.metrics.csv_tables import header, read_table
from gspure.model import write_model
from gspure.workflow.config import SchemeConfig, VariantConfig
from tests.documentation import PAGES, ROOT, blocks, example, install_example, workflow_edges
from tests.models import blobs
from tests.workflow_cases import configuration

DOCS = ROOT / "docs"
TABLES = sorted((DOCS / "tables").glob("*.csv"))
RESULTS = (DOCS / "results.md").read_text(encoding="utf-8")
SECTIONS = {section.partition("\n")[0]: section for section in RESULTS.split("\n## ")[1:]}
DECIMAL = re.compile(r"\d+\.\d+")


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
    assert named == {name for name in vars(constants) if name.isupper()} - {"ENERGIES", "MAX_SH_DEGREE", "NOISE_LABEL"}


def test_functions_that_the_method_page_names_exist():
    table = re.findall(r"^\| [PO] \|.*\| (.*) \|$", (DOCS / "method.md").read_text(encoding="utf-8"), re.MULTILINE)
    found = [name for cell in table for name in re.findall(r"`([a-z_]+(?:\.[a-z_]+)?)\.(\w+(?:\.\w+)?)`", cell)]
    names = [(module, attribute) for module, attribute in found if attribute != "cl"]
    assert len(names) > 10
    for module, attribute in names:
        attrgetter(attribute)(importlib.import_module(f"gspure.{module}"))


def test_the_page_of_attacks_lists_the_built_in_ones_with_their_settings():
    section = (DOCS / "attacks.md").read_text(encoding="utf-8").partition("## ")[0]
    listed = re.findall(r"^\| `(\w+)` \|.*\|(.*)\|[ \w]*\|$", section, re.MULTILINE)
    shown = {name: dict(setting.split("=") for setting in re.findall(r"`(\S+)`", cell)) for name, cell in listed}
    settings = {a.name: {name: str(default) for name, default in a.settings.items()} for a in BUILT_IN}
    assert list(shown.items()) == list(settings.items())


@pytest.mark.workflow
def test_arrows_of_the_diagram_are_arrows_of_the_workflow(tmp_path):
    drawing = (DOCS / "pictures" / "workflow.svg").read_text(encoding="utf-8")
    arrows = re.findall(r"<title>(\w+) → (\w+)</title>", drawing)
    assert len(arrows) > 12
    assert set(arrows) <= workflow_edges(tmp_path)


def test_the_example_of_a_package_is_registered_configured_and_works(tmp_path, monkeypatch):
    install_example(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    config = configuration(yaml.safe_load(blocks(DOCS / "extending.md", "yaml")[0]))
    assert config.variants["faint_half"] == VariantConfig({"share": 0.5}, attack="faint_pruning", seed=1)
    assert config.schemes["faint_splats"] == SchemeConfig({"iterations": 1500})
    model, weights = blobs(40), np.arange(40, dtype=np.float32)[::-1].copy()
    attacked = attacks()["faint_pruning"].apply(model, Measurements(weights=weights), share=0.5)
    assert attacked.prune_mask.tolist() == [False] * 20 + [True] * 20
    assert attacked.model.table.tobytes() == model.table[:20].tobytes()


def test_the_example_of_bits_in_the_file_reads_them_unless_they_were_rounded(tmp_path, monkeypatch, capsys):
    write_model(tmp_path / "model.ply", blobs(400))
    monkeypatch.setattr("sys.argv", ["low_bits.py", str(tmp_path / "model.ply")])
    exec(example("low_bits"), {})  # noqa: S102
    unchanged, rounded = (float(line.split()[1]) for line in capsys.readouterr().out.splitlines())
    assert unchanged == 1
    assert 0.3 < rounded < 0.7


def numbers(table: Path) -> set[float]:
    """Return the sizes of all decimal numbers of a table."""
    return {float(number) for number in DECIMAL.findall(table.read_text(encoding="utf-8"))}


@pytest.mark.parametrize("section", SECTIONS)
def test_decimals_of_the_results_stand_in_a_linked_table_possibly_with_more_digits(section: str) -> None:
    text = SECTIONS[section]
    links = re.findall(r"\(((?:tables|results)/[\w/-]+\.csv)\)", text)
    known = set[float]().union(*(numbers(DOCS / link) for link in links))
    for number in DECIMAL.findall(text):
        half = 0.5 * 10.0 ** -len(number.partition(".")[2]) + 1e-9
        assert any(abs(float(number) - value) <= half for value in known), number


def test_committed_results_can_be_read():
    for folder in ("large", "networks"):
        for table in sorted((DOCS / "results" / folder).glob("*.csv")):
            outcomes, _ = read_results(table)
            assert any(o.psnr_drop("scene") > 0 for o in outcomes), table


def test_the_page_of_formats_names_the_columns_of_the_metrics():
    assert f"`{','.join(header(ViewMetrics))}`" in (DOCS / "formats.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.stem)
def test_tables_of_the_results_are_rectangular_and_described(table: Path) -> None:
    with table.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    assert rows
    assert {len(row) for row in rows} == {len(header)}
    assert f"`{table.stem.partition('-')[0]}`" in (DOCS / "tables" / "README.md").read_text(encoding="utf-8")


def test_the_leaderboard_shows_the_least_damage_at_which_each_message_is_lost(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "setup"))
    leaderboard = importlib.import_module("leaderboard")
    rows = read_table(DOCS / "results" / "six_pairs" / "survival.csv", Survival)
    of_owner = [r for r in rows if r.condition == ("gs_hider", "own", "both") and r.extraction == "message"]
    lost = min(row.scene_drop.mean for row in of_owner if not row.survived)
    page = leaderboard.leaderboard_page()
    (row,) = re.findall(r"<tr><td>GS-Hider, own poses</td>.*?</tr>", page)
    assert set(re.findall('href="#(gs_hider[^"]+)"', row)) <= set(re.findall('id="([^"]+)"', page))
    assert row.count("href") == len(leaderboard.SHOWN)
    assert re.findall(r'data-sort="([^"]+)">', row)[0] == f"{lost:.3f}"
    assert len(re.findall("<td", row)) == len(re.findall("<th>", leaderboard.table(rows)))
