"""The documentation agrees with the code: links, constants, functions, diagrams, the example of a package."""

import csv
import doctest
import importlib
import inspect
import json
import re
from math import inf, nan
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest
import yaml

import gspure
from experiments import leaderboard_page, results_page
from experiments.page_constants import CONSTANTS
from experiments.page_numbers import NUMBERS
from gspure.attacks import BUILT_IN, Measurements, attacks
from gspure.codec import plain
from gspure.evaluation.identity import Condition
from gspure.evaluation.radius import Radius, Record
from gspure.grouping import grouped
from gspure.model import write_model
from gspure.workflow.config import SchemeConfig, VariantConfig
from tests.documentation import PAGES, ROOT, blocks, example, install_example
from tests.models import blobs
from tests.workflow_cases import configuration

DOCS = ROOT / "docs"
TABLES = sorted(results_page.TABLES.glob("*.csv"))
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


def test_every_constant_of_the_renderer_and_the_method_is_explained():
    lines = (ROOT / "gspure" / "constants.py").read_text(encoding="utf-8").splitlines()
    constants = [i for i, line in enumerate(lines) if re.match(r"[A-Z][A-Z0-9_]+: Final", line)]
    assert len(constants) > 30
    for i in constants:
        assert "  # " in lines[i] or lines[i + 1].startswith('"""'), lines[i]


def test_functions_that_the_method_page_names_exist():
    table = re.findall(r"^\| [PO] \|.*\| (.*) \|$", (DOCS / "method.md").read_text(encoding="utf-8"), re.MULTILINE)
    found = [name for cell in table for name in re.findall(r"`([a-z_]+(?:\.[a-z_]+)?)\.(\w+(?:\.\w+)?)`", cell)]
    names = [(module, attribute) for module, attribute in found if attribute != "cl"]
    assert len(names) > 10
    for module, attribute in names:
        attrgetter(attribute)(importlib.import_module(f"gspure.{module}"))


def test_the_page_of_attacks_names_every_built_in_one_once():
    section = (DOCS / "attacks.md").read_text(encoding="utf-8").partition("## Choosing")[2].partition("## ")[0]
    named = re.findall(r"`(\w+)`", section)
    assert sorted(named) == sorted(attack.name for attack in BUILT_IN)


@pytest.mark.parametrize("attack", BUILT_IN, ids=attrgetter("name"))
def test_an_attack_explains_its_settings_and_names_its_source(attack):
    text = inspect.getdoc(attack.function)
    assert re.search(r"^Source: .*\w", text, re.MULTILINE)
    assert {*attack.settings} <= {*re.findall(r"`(\w+)`", text)}


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


def test_the_results_are_generated_from_the_tables_and_begin_with_what_these_say() -> None:
    text = results_page.PAGE.read_text(encoding="utf-8")
    assert text == results_page.page(), "run python -m experiments.results_page"
    with (results_page.TABLES / "captures-measures.csv").open(newline="", encoding="utf-8") as file:
        of_condition = grouped(csv.DictReader(file), lambda row: row["condition"])
    rows = {row["attack"]: row for row in of_condition["Splats in Splats, own poses, message (adaptive)"]}
    repaired, purified = (rows[attack] for attack in ("prune_repair", "gspure"))
    claim = next(line for line in text.splitlines() if line.startswith("| Is it on photographs?"))
    shown = DECIMAL.findall(claim)
    assert shown == [row[drop] for row in (repaired, purified) for drop in ("drop of message", "drop of scene")]
    assert float(repaired["drop of message"]) >= float(purified["drop of message"])
    assert float(repaired["drop of scene"]) < float(purified["drop of scene"])


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.stem)
def test_tables_of_the_results_are_rectangular_and_described(table: Path) -> None:
    with table.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    assert rows
    assert {len(row) for row in rows} == {len(header)}
    assert re.search(rf"`{table.stem.partition('-')[0]}\b", (results_page.HERE / "README.md").read_text())


def radius(
    condition: Condition, value: float, kind: str = "message", owner: str = "adaptive", **more: object
) -> Radius:
    """Return a radius over two scenes."""
    facts = {"exceeds": False, "low": 0.0, "high": 9.0, "scenes": 2, "killer": "gspure_scaled@1dB"} | more
    return Radius(condition, kind, owner, "message", value, **facts)


def test_the_leaderboard_ranks_schemes_by_the_radius_of_the_owner_who_adapts(tmp_path, monkeypatch):
    monkeypatch.setattr(leaderboard_page, "RECORDS", tmp_path)
    assert leaderboard_page.NO_RECORD in leaderboard_page.page()
    weak, strong, unknown = (Condition(name, "own", "both") for name in ("gs_hider", "keyss", "secure_gs"))
    found = [
        radius(unknown, nan, exceeds=True),
        radius(weak, 0.98),
        radius(weak, 0.01, owner="published"),
        radius(weak, 0.4, kind="readable"),
        radius(strong, 1.5, exceeds=True, high=inf, killer=""),
    ]
    record = Record("0.1.0", "small-1", "2026-11-29", 2, "96x72", "", tuple(found), ())
    (tmp_path / "run.json").write_text(json.dumps(plain(record)))
    page = leaderboard_page.page()
    rows = [re.findall("<td.*?</td>", row) for row in re.findall("<tr>(.*?)</tr>", page)[1:]]
    texts = [[re.sub("<.*?>", "", cell) for cell in row] for row in rows]
    assert texts == [
        ["KeySS", "own", "small-1", "2", "&gt; 1.5 dB", "–", "–", "–"],
        ["GS-Hider", "own", "small-1", "2", "0.98 dB", "&lt; 0.05 dB", "0.40 dB", "GSPure scaled, 1 dB"],
        ["SecureGS", "own", "small-1", "2", "–", "–", "–", "GSPure scaled, 1 dB"],
    ]
    assert [re.findall('class="(.*?)"', "".join(row)) for row in rows] == [["holds"], ["broken"] * 3, []]


@pytest.mark.parametrize("name", [name for name in gspure.__all__ if ">>> " in (getattr(gspure, name).__doc__ or "")])
def test_the_examples_of_the_public_functions_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    model = blobs(400, sh_degree=1)
    gspure.write_model("model.ply", model)
    gspure.write_cameras("cameras.json", gspure.orbit_cameras(model, count=8, width=48, height=36, up=(0, 0, 1)))
    known = {"gspure": gspure, "np": np, "model": model, "cameras": gspure.read_cameras("cameras.json")}
    (test,) = doctest.DocTestFinder(recurse=False).find(getattr(gspure, name), name, globs=known)
    assert doctest.DocTestRunner().run(test).failed == 0


def plain_numbers(text: str) -> str:
    """Return Markdown on one line, with powers of ten and minus signs as programs print them."""
    digits = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")
    text = re.sub(r"·10(?=[⁻⁰-⁹¹²³])", "e", " ".join(text.split()))
    text = re.sub(r"\b10(?=[⁻⁰-⁹¹²³])", "1e", text)
    text = re.sub(r"\s*\\cdot\s*10\^\{(-?\d+)\}", r"e\1", text)
    text = re.sub(r"\b10\^\{(-?\d+)\}", r"1e\1", text)
    return text.translate(digits)


def numbers_shown(page: str, text: str) -> list[str]:
    """Return the numbers at the places of ``#`` in a text that occurs once in a page."""
    parts = [re.escape(part) for part in plain_numbers(text).split("#")]
    found = re.findall(r"(-?[\d,]*\.?\d+(?:e-?\d+)?)".join(parts), plain_numbers((ROOT / page).read_text()))
    assert len(found) == 1, found
    return [*found[0]] if isinstance(found[0], tuple) else found


@pytest.mark.parametrize(("page", "text"), [(page, text) for page, texts in NUMBERS.items() for text in texts])
def test_a_measured_number_of_a_page_is_that_of_its_table(page: str, text: str) -> None:
    for number, value in zip(numbers_shown(page, text), NUMBERS[page][text], strict=True):
        mantissa, _, power = number.replace(",", "").partition("e")
        last_place = 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))
        assert float(number.replace(",", "")) == pytest.approx(value, abs=0.5001 * last_place, rel=0)


@pytest.mark.parametrize(("page", "text"), [(page, text) for page, texts in CONSTANTS.items() for text in texts])
def test_a_constant_on_a_page_is_that_of_the_code(page: str, text: str) -> None:
    shown = [float(number.replace(",", "")) for number in numbers_shown(page, text)]
    assert shown == pytest.approx(CONSTANTS[page][text], rel=1e-9)
