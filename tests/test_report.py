"""The report of a folder of results: its tables, its figures and its page, also of an unfinished run; any table."""

import csv
import html
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.cameras import write_cameras
from gspure.cli import main
from gspure.codec import plain, read
from gspure.evaluation.plan import Plan
from gspure.evaluation.radius import Record
from gspure.figures import style
from gspure.files import read_json, write_json, write_text
from gspure.metrics.statistics import Interval
from gspure.report.page import environment
from gspure.report.table import Cell, Column, Table, TableRow, interval
from gspure.report.writing import write_report
from gspure.viewer.data import write_viewer
from tests.models import camera
from tests.outcome_cases import model_plan, write_model
from tests.test_viewer import purified

ATTACKS = {"gspure": (0.055, 1.0), "noise": (0.2, 0.02), "noise_2": (0.3, 0.3)}
NAME = "sis/room"


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    """The folder of a finished run with two scenes, one of which lacks an attack."""
    patch = pytest.MonkeyPatch()
    patch.setattr(style, "DPI", 60)
    results = tmp_path_factory.mktemp("run") / "results"
    plans = tuple(write_model(results, name, ATTACKS) for name in (NAME, "sis/vault"))
    shutil.rmtree(results / "sis" / "vault" / "noise")
    write_text(results / "logs" / "sis" / "vault" / "noise" / "attack.log", "gspure attack: <b>no memory</b>\n")
    model = results / NAME / "figures" / "model"
    write_viewer(model / "view.json", purified(300), [])
    shutil.copy(results / "pairs" / "room" / "scene" / "view_0.png", model / "kept.png")
    for name in ("weights.png", "purification.png"):
        shutil.copy(model / "kept.png", model / name)
    write_json(model / "captions.json", {"kept.png": "What is kept.", "weights.png": "Weights & thresholds."})
    write_json(results / NAME / "diagnosis.json", {"gaussians": 1200, "noise_share": 0.25, "warnings": ["one cluster"]})
    points = {"sis": {"gspure": (4.0, 4.0), "noise": (2.0, 4.0)}}
    write_json(results / "configuration.json", {})
    sweeps = {"noise": ("noise", "noise_2")}
    write_report(results, Plan(plans, sweeps=sweeps, factors=points, meanings={"gspure": "What it does."}))
    patch.undo()
    return results


@pytest.fixture(scope="module")
def page(run: Path) -> str:
    return (run / "report.html").read_text()


def test_all_tables_are_written_and_name_what_is_missing(run: Path) -> None:
    assert {path.name for path in (run / "tables").iterdir()} == {"results.csv", "results.md"}
    rows = [*csv.DictReader((run / "tables" / "results.csv").read_text().splitlines())]
    (missing,) = (row for row in rows if (row["scene"], row["variant"]) == ("vault", "noise"))
    assert missing["failure"] == "gspure attack: <b>no memory</b>"
    assert "Without results: noise on sis, vault" in (run / "tables" / "results.md").read_text()


def test_the_radius_of_every_model_and_condition_is_written(run: Path) -> None:
    record = read_json(run / "radius.json")
    models = {(one["model"]["scene"], one["kind"]): one for one in record["models"]}
    assert {(one["owner"], one["killer"]) for one in models.values()} == {("published", "gspure")}
    (radius,) = (one for one in record["conditions"] if one["kind"] == "message")
    known = [models[scene, "message"]["radius"] for scene in ("room", "vault")]
    assert (radius["radius"], radius["low"], radius["high"]) == (min(known), min(known), max(known))
    assert radius["scenes"] == 2


def test_the_figures_of_models_and_conditions_are_drawn(run: Path) -> None:
    for name in (NAME, "sis/vault"):
        assert {path.name for path in (run / name / "figures").glob("*.*")} == {"attacks.png"}
    of_condition = {path.name for path in (run / "figures" / "sis-shared-both").iterdir()}
    assert of_condition == {"evidence.png", "evidence.svg", "sweep.png", "sweep.svg"}


def test_the_page_answers_first_and_tells_what_is_missing(run: Path, page: str) -> None:
    visible = re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL)
    text = " ".join(html.unescape(re.sub(r"<[^>]+>", " ", visible)).split())
    assert text.index("BROKEN: the message is gone at ") < 200
    assert text.index("2 scenes, 1 seed") < text.index("scene, published") < text.index("attack (click") < 1500
    assert "What it does." in text
    assert "Without results: noise on sis, vault (gspure attack: <b>no memory</b>)" in text
    assert "<b>no memory" not in page
    assert "kept.png" in text
    assert {path.name for path in (run / "figures").glob("*.png")} == {"purification.png"}
    for words in ("Weights & thresholds.", "One cluster.", "1,200", "25.0%", "Prune from the lowest rank up"):
        assert words in text, words
    assert "What is left: message" in text


def test_the_page_is_self_contained_and_its_links_have_targets(run: Path, page: str) -> None:
    markup = re.sub(r"(<(script|style)[^>]*>).*?(?=</\2>)", r"\1", page, flags=re.DOTALL)
    ids = re.findall(r' id="([^"]+)"', markup)
    sources = re.findall(r' src="([^"]+)"', markup)
    assert len({*ids}) == len(ids)
    assert all(source.startswith("data:image/webp") for source in sources)
    links = re.findall(r'<a [^>]*href="([^"]+)"', markup)
    for link in links:
        assert link.removeprefix("#") in ids if link.startswith("#") else (run / link).is_file() or link == "logs", link
    assert {"tables/results.csv", "configuration.json"} <= {*links}


def test_two_runs_are_compared_and_one_of_a_suite_is_submitted(run: Path, tmp_path: Path, capsys) -> None:
    assert main(["compare", str(run), str(run)]) == 0
    radius = re.search(r"message radius: (\S+ dB) → (\S+ dB)", capsys.readouterr().out)
    assert radius
    assert radius[1] == radius[2]
    out = tmp_path / "record.json"
    plan = Plan((model_plan(NAME, ("unattacked", "gspure"), ("clean",)),))
    write_cameras(run / NAME / "cameras.json", [camera(32, 24)])
    write_json(run / "plan.json", plain(plan))
    assert main(["submit", str(run), "--out", str(out)]) == 2
    assert "suite: expected a run of a suite" in capsys.readouterr().err
    write_json(run / "plan.json", plain(replace(plan, suite="small-1")))
    assert main(["submit", str(run), "--out", str(out)]) == 0
    record = read(Record, read_json(out), out)
    assert (record.suite, record.scenes, record.size) == ("small-1", 2, "32x24")
    assert {str(one) for one in record.conditions if one.kind == "message"} == {radius[1]}


def cells_of_html(table: Table) -> list[list[str]]:
    text = str(environment().get_template("parts.html.j2").module.table_of(table))
    rows = re.findall(r"<tr.*?>(.*?)</tr>", text, flags=re.DOTALL)
    cells = [re.findall(r"<t[hd].*?>(.*?)</t[hd]>", row, flags=re.DOTALL) for row in rows]
    return [[html.unescape(re.sub(r"<[^>]*>", "", cell)) for cell in row] for row in cells]


@pytest.mark.parametrize(
    ("mean", "text"),
    [
        (Interval(1.0, 0.5, 1.5, 0.95, 6), "1.00 [0.50, 1.50]"),
        (Interval(1.0, -0.5, 1.5, 0.75, 3), "1.00 (−0.50 to 1.50) (3 of 6 scenes)"),
        (Interval(1.0, 1.0, 1.0, 0.0, 1), "1.00 (1 of 6 scenes)"),
        (None, "–"),
    ],
)
def test_intervals_have_brackets_ranges_parentheses_and_fewer_scenes_a_count(mean, text: str) -> None:
    assert str(interval(mean, 6)) == text


TEXTS = st.text(alphabet="ab |\\{}$&#_%~^-<>\"'", max_size=8).map(str.strip)


@given(TEXTS, TEXTS)
def test_every_format_shows_the_same_cells_and_takes_no_character_for_markup(first: str, second: str) -> None:
    cells = [Cell(first), Cell(second, "(11.00 to 14.00)", best=True)]
    table = Table("Drops", [Column("attack"), Column("message", "PSNR drop")], [TableRow(cells, "best")])
    assert cells_of_html(table) == [["attack", "PSNR drop message"], [*map(str, cells)]]
    titles, _, row = table.markdown().splitlines()
    assert [title.strip() for title in titles.strip("|").split("|")] == ["attack", "PSNR drop message"]
    shown = [cell.strip(" *") for cell in re.split(r"(?<!\\)\|", row)[1:-1]]
    assert shown == [str(cell).replace("|", r"\|").strip(" *") for cell in cells]
