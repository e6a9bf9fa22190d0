"""Tables of docs/results.md follow from the committed tables of runs."""

import re
import shutil
from pathlib import Path

import pytest

from benchmarks.results import GENERATED, PAGES, RUNS, TABLES, filled
from gspure.evaluation.costs import AttackCost
from gspure.evaluation.csv_tables import write_table
from gspure.evaluation.matched import Matched, match
from gspure.evaluation.outcomes import Condition
from gspure.evaluation.summary import Summary, summarize
from gspure.evaluation.survival import Survival, survival
from tests.contest_cases import benchmark

SCRIPT = """\
scheme,protocol,bound,rows,removed,attack,extraction,scene,message,message_drop,scene_drop,random_message_drop,\
random_scene_drop,low_share
gs_hider,own,3000,2900,0.50,gspure,message,30.10,12.24,-9.81,0.10,2.25,2.26,0.1
gs_hider,own,3000,2900,0.50,gspure,message_adaptive,30.10,15.26,9.81,0.10,2.25,2.26,0.1
gs_hider,shared,3000,2900,0.50,clean,message,29.10,14.24,9.81,0.10,2.25,2.26,0.1
gs_hider,shared,3000,2900,0.50,clean,message_adaptive,29.10,15.26,9.81,0.10,2.25,2.26,0.1
splats_in_splats,shared,3000,2900,0.50,gspure,message,30.10,12.24,9.81,0.10,2.25,2.26,0.6
splats_in_splats,shared,3000,2900,0.50,gspure,message,30.50,12.44,9.81,0.10,2.25,2.26,0.8
splats_in_splats,shared,3000,2900,0.50,gspure,message_adaptive,30.10,13.24,9.81,0.10,2.25,2.26,0.6
splats_in_splats,shared,3000,2900,0.50,gspure,message_oracle,30.10,14.24,9.81,0.10,2.25,2.26,0.6
"""

OWN, SHARED = (Condition("gs_hider", protocol, "both") for protocol in ("own", "shared"))


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """A folder with one run, two scenes under each of two conditions, and one table of a script."""
    outcomes = [
        *benchmark(
            {s: {"gspure": (1.25, 12.5), "x": (2.0, 3.0), "x@1dB": (0.75, 3.5), "x@2dB": (2.0, 4.0)} for s in "ab"},
            **OWN._asdict(),
        ),
        *benchmark({s: {"gspure": (1.75, 2.5)} for s in "cd"}, **SHARED._asdict()),
    ]
    write_table(tmp_path / "run" / "survival.csv", Survival, survival(outcomes))
    write_table(tmp_path / "run" / "summary.csv", Summary, summarize(outcomes))
    costs = [AttackCost(*OWN, kind, "x", cpu, 300.4) for kind, cpu in (("variant", 9.0), ("sweep", 1.26))]
    write_table(tmp_path / "run" / "attacks.csv", AttackCost, costs)
    write_table(tmp_path / "run" / "matched.csv", Matched, match(outcomes, {"x": ["x", "x@1dB", "x@2dB"]}))
    (tmp_path / "run.csv").write_text(SCRIPT)
    return tmp_path


def page(kind: str, between: str = "") -> str:
    return f"# Results\n\n<!-- run: {kind} -->\n{between}<!-- end -->\n\nMore.\n"


def rows(text: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]


def test_the_tables_of_the_pages_are_those_of_the_committed_runs() -> None:
    runs = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert text == filled(text), "python -m benchmarks.results"
        runs |= {match["run"] for match in GENERATED.finditer(text)}
        assert text.count("<!-- end -->") == len([*GENERATED.finditer(text)])
        assert text.count("<!--") == 2 * text.count("<!-- end -->")
    assert {folder.name for folder in RUNS.glob("*/")} <= runs


@pytest.mark.parametrize("kind", [*(table.__name__ for table in TABLES), "gs_hider"])
def test_an_edited_number_is_noticed(runs: Path, kind: str) -> None:
    text = filled(page(kind), runs)
    assert filled(text, runs) == text
    assert text.startswith("# Results")
    assert text.endswith("More.\n")
    edited = re.sub(r"\d\.\d", lambda m: f"{float(m[0]) + 0.1:.1f}", text, count=1)
    assert edited != text
    assert filled(edited, runs) == text


def test_every_attack_has_its_drops_under_every_condition(runs: Path) -> None:
    header, _, gspure, x = rows(filled(page("attacks"), runs))
    assert header == ["attack", "GS-Hider, own poses", "GS-Hider, shared poses"]
    assert gspure == ["`gspure`", "12.50 / 1.25 (2 of 2)", "2.50 / 1.75 (2 of 2)"]
    assert x == ["`x`", "3.00 / 2.00 (2 of 2)", "–"]


def test_every_measure_of_an_attack_is_in_one_row(runs: Path) -> None:
    header, _, gspure, x, *_ = rows(filled(page("measures"), runs))
    assert header[-3:] == ["message: survives", "message: retrieved only", "message: gone"]
    assert gspure[:4] == ["GS-Hider, own poses", "`gspure`", "12.50 (12.50 to 12.50)", "1.25 (1.25 to 1.25)"]
    assert gspure[-3:] == ["2", "0", "0"]
    assert x[:3] == ["", "`x`", "3.00 (3.00 to 3.00)"]


def test_owners_are_shown_with_each_extraction_and_means_over_seeds(runs: Path) -> None:
    header, _, gspure, clean = rows(filled(page("adaptive"), runs))
    assert header == ["attack", "GS-Hider, own poses", "GS-Hider, shared poses"]
    assert gspure == ["`gspure`", "30.1 / 12.2 / 15.3", "–"]
    assert clean == ["*clean model*", "–", "29.1 / 14.2 / 15.3"]
    _, _, hardened, weight = rows(filled(page("hardening"), runs))
    assert hardened == ["`gspure`", "30.2 / 12.3 / 13.2 / 14.2"]
    assert weight[1] == "65.0%"


def test_the_contest_shows_what_is_left_above_the_floor_at_each_damage(runs: Path) -> None:
    header, _, before, x, gspure = rows(filled(page("gs_hider"), runs))
    assert header[2:5] == ["shared poses: 0.3 dB", "shared poses: 1 dB", "shared poses: 2 dB"]
    assert before[:2] == ["`unattacked`", "literal"]
    assert before[2:8] == ["18.0"] * 6
    assert gspure[2:8] == ["–", "–", "≤ 15.5", "–", "–", "≤ 5.5"]
    assert x == ["`x`", "literal", "–", "–", "–", "–", "≤ 14.5", "14.0", "1.3", "300"]


def test_capacity_compares_gspure_with_random_pruning(runs: Path) -> None:
    _, _, own, *_ = rows(filled(page("capacity"), runs))
    assert own == ["GS-Hider, own poses", "3000", "2900", "50%", "30.10 / 12.24", "−9.81 / 0.10", "2.25 / 2.26"]


def test_the_page_shows_quality_before_attacks_beside_the_controls(runs: Path) -> None:
    _, _, own, shared = rows(filled(page("before"), runs))
    assert own[0] == "GS-Hider, own poses"
    assert [cell.split()[0] for cell in own[1:]] == ["30.00", "–", "28.00", "7.00", "8.00", "–", "–"]
    assert own[1:] == shared[1:]


def test_drops_at_equal_damage_name_the_damage_that_was_reached(runs: Path) -> None:
    header, _, *body = rows(filled(page("equal"), runs))
    assert header[2:] == ["scene drop of 1 dB", "scene drop of 2 dB"]
    assert body == [["GS-Hider, own poses", "`x`", "≥ 3.50 (3.50 to 3.50) at 0.75 dB", "4.00 (4.00 to 4.00)"]]


def test_the_paper_s_numbers_need_no_run_of_ours(runs: Path) -> None:
    shutil.rmtree(runs / "run")
    assert len(rows(filled(page("paper"), runs))) == 2 + 15
