"""Tables of docs/results.md follow from the committed tables of runs."""

import re
import shutil
from pathlib import Path

import pytest
import yaml

from benchmarks.contest import SCHEMES
from benchmarks.results import GENERATED, KINDS, PAGE, PAGES, RUNS, TABLES, complete, filled
from gspure.artifacts import write_text
from gspure.evaluation.costs import AttackCost
from gspure.evaluation.csv_tables import read_table, write_table
from gspure.evaluation.matched import Matched, match
from gspure.evaluation.outcomes import Condition
from gspure.evaluation.summary import Summary, summarize
from gspure.evaluation.survival import Survival, survival
from tests.contest_cases import benchmark

CONFIG = PAGE.parents[1] / "config"

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

STRENGTHS = {
    "gspure": (1.25, 12.5),
    "gspure@1dB": (1.0, 12.0),
    "gspure@2dB": (2.0, 13.0),
    "x": (2.0, 3.0),
    "x@1dB": (0.75, 3.5),
    "x@2dB": (2.0, 4.0),
}
SWEEPS = {name: [variant for variant in STRENGTHS if variant.startswith(name)] for name in ("gspure", "x")}

DECIMAL = re.compile(r"(?<![\w.])\d+\.\d+")
INTERVAL = re.compile(r"\[[^\]]*\]|\([^)]* to [^)]*\)")

OWN, SHARED = (Condition("gs_hider", protocol, "both") for protocol in ("own", "shared"))


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    """A folder with one run, two scenes under each of two conditions, and one table of a script."""
    outcomes = [
        *benchmark(
            dict.fromkeys("ab", STRENGTHS),
            **OWN._asdict(),
        ),
        *benchmark({s: {"gspure": (1.75, 2.5)} for s in "cd"}, **SHARED._asdict()),
    ]
    write_table(tmp_path / "run" / "survival.csv", Survival, survival(outcomes))
    write_table(tmp_path / "run" / "summary.csv", Summary, summarize(outcomes))
    costs = [AttackCost(*OWN, kind, "x", cpu, 300.4) for kind, cpu in (("variant", 9.0), ("sweep", 1.26))]
    write_table(tmp_path / "run" / "attacks.csv", AttackCost, costs)
    write_table(tmp_path / "run" / "matched.csv", Matched, match(outcomes, SWEEPS))
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


def test_the_contest_on_captures_has_the_variants_of_the_contest_and_the_pair_of_the_captures() -> None:
    names = ("contest_capture", "contest", "captures")
    on_captures, contest, captures = (yaml.safe_load((CONFIG / f"{name}.yaml").read_text()) for name in names)
    assert contest["variants"] | on_captures["variants"] == contest["variants"]
    assert on_captures["schemes"].keys() <= contest["schemes"].keys() == {*SCHEMES}
    assert on_captures["pairs"] == {"captures_own": captures["pairs"]["captures_own"] | {"resolution": "160px"}}


def unsupported(text: str) -> list[str]:
    """Return the decimals of the text that no table of their section has.

    In a paragraph, those rows count that are of no attack or of one that it names.
    """
    missing = []
    for section in re.split(r"^## ", text, flags=re.MULTILINE):
        table = [INTERVAL.sub("", line) for line in section.splitlines() if line.startswith("|")]
        for paragraph in re.split(r"\n(?=- |\n|\*\*)", re.sub(r"^[|<].*|^    .*", "", section, flags=re.MULTILINE)):
            known = [float(n) for row in table if is_about(paragraph, row) for n in DECIMAL.findall(row)]
            for number in DECIMAL.findall(paragraph):
                tolerance = 0.501 * 10.0 ** -len(number.partition(".")[2])
                if not any(abs(value - float(number)) <= tolerance for value in known):
                    missing.append(f"{number}: {paragraph.strip()}")
    return missing


def is_about(paragraph: str, row: str) -> bool:
    """Whether a row of a table is of no attack, or of one of which the paragraph has the first or last word."""
    attack = re.search(r"\| `(\w+)` +\|", row)
    words = attack[1].split("_") if attack else [""]
    return any(word in paragraph.casefold() for word in (words[0], words[-1]))


def test_every_decimal_of_the_text_is_in_a_table_of_its_section() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert unsupported(text) == []
    edited = re.sub(r"(?<=loses )\d+\.\d", "99.9", text, count=1)
    assert len(unsupported(edited)) == 1


def test_gspure_leads_under_the_conditions_of_the_text() -> None:
    table = rows(KINDS["leads"](RUNS / "six_pairs").markdown())[2:]
    leading = {row[0] for row in table if {cell[0] for cell in row[5:]} <= {"+", "–"}}
    assert leading == {
        "GS-Hider, own poses",
        "SecureGS, own poses",
        "Splats in Splats, own poses, message (oracle)",
        "Splats in Splats, own poses, scene's points, message (oracle)",
        "Splats in Splats, shared poses, message (oracle)",
        "Splats in Splats, shared poses, scene's points, message (oracle)",
    }


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


def test_an_older_table_of_a_run_gets_the_columns_that_it_lacks(runs: Path) -> None:
    file = runs / "run" / "survival.csv"
    rows = read_table(file, Survival)
    older = [line.rsplit(",", 5)[0] for line in file.read_text().splitlines()]  # without the last field
    write_text(file, "\n".join(older) + "\n")
    complete(file)
    assert repr(read_table(file, Survival)) == repr([row._replace(damage=None) for row in rows])
    written = file.read_text()
    complete(file)
    assert file.read_text() == written


def test_owners_are_shown_with_each_extraction_and_means_over_seeds(runs: Path) -> None:
    header, _, gspure, clean = rows(filled(page("adaptive"), runs))
    assert header == ["attack", "GS-Hider, own poses", "GS-Hider, shared poses"]
    assert gspure == ["`gspure`", "30.1 / 12.2 / 15.3", "–"]
    assert clean == ["*clean model*", "–", "29.1 / 14.2 / 15.3"]
    _, _, hardened, weight = rows(filled(page("hardening"), runs))
    assert hardened == ["`gspure`", "30.2 / 12.3 / 13.2 / 14.2"]
    assert weight[1] == "65.0%"


def test_the_contest_shows_what_is_left_above_the_floor_at_each_damage(runs: Path) -> None:
    header, _, before, gspure, x = rows(filled(page("gs_hider"), runs))
    assert header[2:5] == ["shared poses: 0.3 dB", "shared poses: 1 dB", "shared poses: 2 dB"]
    assert before[:2] == ["`unattacked`", "literal"]
    assert before[2:8] == ["18.0"] * 6
    assert gspure[2:8] == ["≥ 15.5", "≥ 15.5", "≤ 15.5", "≥ 5.5", "6.0", "5.0"]
    assert x == ["`x`", "literal", "–", "–", "–", "≥ 15.0", "≤ 14.5", "14.0", "1.3", "300"]


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
    assert body[0] == ["GS-Hider, own poses", "`gspure`", "12.00 (12.00 to 12.00)", "13.00 (13.00 to 13.00)"]
    assert body[1:] == [["", "`x`", "≥ 3.50 (3.50 to 3.50) at 0.75 dB", "4.00 (4.00 to 4.00)"]]


def test_the_lead_is_over_the_strongest_other_attack_and_unknown_if_that_is(runs: Path) -> None:
    header, _, own, shared = rows(filled(page("leads"), runs))
    assert (header[0], header[5:]) == ("condition", ["lead at 1 dB", "lead at 2 dB"])
    assert own[1:3] == ["12.50 (12.50 to 12.50)", "1.25 (1.25 to 1.25)"]
    assert (own[5:], shared[5:]) == (["+8.50 (`x`)", "+9.00 (`x`)"], ["–", "–"])
    matched = runs / "run" / "matched.csv"
    known = [row for row in read_table(matched, Matched) if (row.sweep, row.damage) != ("x", 2)]
    write_table(matched, Matched, known)
    assert rows(filled(page("leads"), runs))[2][5:] == ["+8.50 (`x`)", "–"]


def test_the_paper_s_numbers_need_no_run_of_ours(runs: Path) -> None:
    shutil.rmtree(runs / "run")
    assert len(rows(filled(page("paper"), runs))) == 2 + 15
