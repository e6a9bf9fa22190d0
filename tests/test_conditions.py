"""Messages at the scene's poses and at poses of their own, and both initializations, are never averaged together."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from gspure.cli import main
from gspure.errors import InputError
from gspure.evaluation.contest import SCORE, contest
from gspure.evaluation.matched import match
from gspure.evaluation.names import condition_name
from gspure.evaluation.outcomes import Condition, Outcome, condition_of
from gspure.evaluation.results import read_results, write_results
from gspure.evaluation.summary import summarize
from gspure.evaluation.survival import survival
from gspure.report.audit import audits
from gspure.report.findings import limits
from gspure.report.page import write_report
from gspure.report.tables import conditions_markdown, summary_table
from tests.contest_cases import attacked, benchmark
from tests.test_tables import results

SHARED, OWN, SCENE_POINTS = (
    Condition("gs_hider", *rest) for rest in (("shared", "both"), ("own", "both"), ("own", "scene"))
)
DROPS = {SHARED: 1.0, OWN: 12.0, SCENE_POINTS: 15.0}


def of_condition(condition: Condition, scenes: str) -> list[Outcome]:
    drops = {f"{scene}_{condition.key}": {"gspure": (1.0, DROPS[condition]), "x": (1.0, 2.0)} for scene in scenes}
    return benchmark(drops, **condition._asdict())


MIXED = [o for scene in "ab" for condition in DROPS for o in of_condition(condition, scene)]


def test_means_are_over_the_scenes_of_one_condition() -> None:
    survivals, summaries = survival(MIXED), summarize(MIXED)
    assert {condition_of(r): r.message_drop.mean for r in survivals if r.variant == "gspure"} == DROPS
    assert {condition_of(r): r.score.mean + 1 for r in summaries if r.variant == "gspure"} == DROPS
    assert {r.message_drop.scenes for r in survivals} == {r.message.scenes for r in summaries} == {2}


def test_attacks_are_compared_within_one_condition() -> None:
    scores = [row for row in contest(MIXED, {}) if row.quantity == SCORE]
    assert {condition_of(row): row.difference.mean + 2 for row in scores} == DROPS
    at_2 = [row for row in match(MIXED, {}) if (row.sweep, row.damage) == ("gspure", 2.0)]
    assert {condition_of(row): row.drop.mean for row in at_2} == DROPS


def test_results_keep_their_conditions_in_a_file(tmp_path: Path) -> None:
    write_results(tmp_path / "results.csv", MIXED)
    assert [o.condition for o in read_results(tmp_path / "results.csv")] == [o.condition for o in MIXED]
    with (tmp_path / "results.csv").open(newline="") as stream:
        assert next(csv.reader(stream))[:4] == ["scheme", "protocol", "initialization", "scene"]


def test_a_model_under_two_conditions_is_refused(tmp_path: Path) -> None:
    """As in two tables, of pairs of one name, that were joined: drops would be from the wrong unattacked model."""
    first_of = [of_condition(condition, "a") for condition in (SHARED, OWN)]
    write_results(tmp_path / "results.csv", [replace(o, scene="room") for outcomes in first_of for o in outcomes])
    with pytest.raises(InputError, match="gs_hider/room: expected one condition, found own both and shared both"):
        read_results(tmp_path / "results.csv")


def test_every_condition_has_a_verdict_tables_and_a_figure_of_its_own(tmp_path: Path) -> None:
    survivals, contests = survival(MIXED), contest(MIXED, {})
    verdicts = {audit.condition: audit.gspure.survived for audit in audits(MIXED, survivals, contests)}
    assert verdicts == {SHARED: 2, OWN: 2, SCENE_POINTS: 2}
    write_report(tmp_path / "report.html", MIXED, survivals=survivals, contests=contests)
    page, tables = (tmp_path / "report.html").read_text(), conditions_markdown(survivals, contests)
    latex = summary_table(MIXED).latex()
    for condition in DROPS:
        assert page.count(f'id="verdict/{condition.key}"') == page.count(f'id="compare/{condition.key}"') == 1
        assert f"## {condition_name(*condition)}\n" in tables
        assert f"{condition_name(*condition)} & " in latex
    write_results(tmp_path / "results.csv", MIXED)
    words = ["--table", str(tmp_path / "results.csv"), "--condition", OWN.key, "--out", str(tmp_path / "tradeoff.png")]
    assert main(["figures", "tradeoff", *words]) == 0


def test_one_scene_of_a_condition_is_one_scene_even_if_others_have_more() -> None:
    few = [*of_condition(SHARED, "ab"), *of_condition(OWN, "a")]
    assert limits(few).one_scene == [OWN]


def test_the_table_command_takes_the_condition_of_each_model(tmp_path: Path, capsys) -> None:
    metrics = [path for scene in ("room", "vault") for path in results(tmp_path, scene)[0]]
    out = tmp_path / "results.csv"
    words = ["table", "--metrics", *map(str, metrics), "--out", str(out), "--markdown", str(tmp_path / "results.md")]
    assert main([*words, "--condition", "planted/room=own,scene", "--condition", "planted/vault=shared,both"]) == 0
    known = {(o.scene, o.condition) for o in read_results(out)}
    assert known == {
        ("room", Condition("planted", "own", "scene")),
        ("vault", Condition("planted", "shared", "both")),
    }
    for conditions, reason in (
        (["planted/room=own"], "expected SCHEME/SCENE=PROTOCOL,INITIALIZATION"),
        (["planted/room=own,scene", "planted/room=shared,both"], "found planted/room again"),
    ):
        with pytest.raises(SystemExit, match="2"):
            main([*words, *(word for condition in conditions for word in ("--condition", condition))])
        assert reason in capsys.readouterr().err


@pytest.mark.parametrize(
    ("condition", "name"),
    [
        (Condition("vanilla"), "Own model"),
        (SHARED, "GS-Hider, shared poses"),
        (SCENE_POINTS, "GS-Hider, own poses, scene's points"),
    ],
)
def test_a_condition_is_named_by_its_distinguishing_settings(condition: Condition, name: str) -> None:
    assert condition_name(*condition) == name


def test_seeds_of_another_condition_are_not_paired() -> None:
    outcomes = [attacked("gspure", 1.0, 9.0, "a", protocol="own"), attacked("x", 1.0, 2.0, "a", protocol="shared")]
    assert contest(outcomes, {}) == []


def test_no_number_depends_on_the_order_of_the_rows_of_a_table(tmp_path: Path) -> None:
    write_results(tmp_path / "results.csv", MIXED)
    header, *rows = (tmp_path / "results.csv").read_text(encoding="utf-8").splitlines()
    for order, column in ((sorted(rows), "scheme"), (sorted(rows, key=lambda row: row.split(",")[6]), "target")):
        (tmp_path / f"{column}.csv").write_text("\n".join([header, *order]) + "\n", encoding="utf-8")
        outcomes = read_results(tmp_path / f"{column}.csv")
        assert len(outcomes) == len(MIXED)
        assert {*map(repr, survival(outcomes))} == {*map(repr, survival(MIXED))}
        assert {*map(repr, contest(outcomes, {}))} == {*map(repr, contest(MIXED, {}))}
        assert {*map(repr, summarize(outcomes))} == {*map(repr, summarize(MIXED))}
