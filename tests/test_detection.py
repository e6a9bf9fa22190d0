"""Readings of detectors: thresholds, and their place in tables and report."""

from __future__ import annotations

import csv
import math
from contextlib import nullcontext
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom

from gspure.artifacts import write_record
from gspure.errors import InputError
from gspure.evaluation.comparison import TRUTH, ViewMetrics
from gspure.evaluation.contest import MESSAGE_DROP, SCORE, contest
from gspure.evaluation.csv_tables import read_table, write_table
from gspure.evaluation.detection import Reading, Threshold, detection, read_detections, share_correct
from gspure.evaluation.metrics import METRICS
from gspure.evaluation.outcomes import Outcome, collect, ordered, with_references
from gspure.evaluation.results import read_results, write_results
from gspure.evaluation.survival import survival
from gspure.failures import Failure, status_of
from gspure.report.audit import audits
from gspure.report.page import Comparison, write_report
from gspure.report.tables import conditions_markdown, results_markdown
from gspure.report.templates import say
from gspure.schemes.readability import bit_readability
from tests.contest_cases import attacked
from tests.test_audit import told

# --- thresholds -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [0.01, 0.001])
@pytest.mark.parametrize("bits", [10, 16, 32, 48])
def test_the_threshold_of_bits_is_the_lowest_that_keeps_the_rate(bits, rate):
    threshold = Threshold.of(bits, [], rate)
    assert threshold.rate == pytest.approx(binom.sf(threshold.value, bits, 0.5))
    assert threshold.rate <= rate
    assert binom.sf(threshold.value - 1, bits, 0.5) > rate


@pytest.mark.parametrize("bits", [24, 30, 48, 56, 96, 131])
def test_views_at_the_threshold_do_not_exceed_it(tmp_path, bits):
    correct = int(Threshold.of(bits, [], 0.01).value)
    message = np.ones(bits, bool)
    rows = [
        Reading(view, share_correct(np.arange(bits) < correct + more, message), bits)
        for more in (0, 1)
        for view in "abcd"
    ]
    write_table(tmp_path / "rows.csv", Reading, rows)
    stored = read_table(tmp_path / "rows.csv", Reading)
    assert stored == rows
    at, above = detection(stored[:4], []), detection(stored[4:], [])
    assert (at.tpr, at.present, above.tpr, above.present) == (0, False, 1, True)


def test_large_scores_keep_their_order(tmp_path):
    write_table(tmp_path / "rows.csv", Reading, [Reading(view, 1234566.0 + i, 0) for i, view in enumerate("ab")])
    first, second = read_table(tmp_path / "rows.csv", Reading)
    assert detection([second], [first.level] * 99).tpr == 1


@pytest.mark.parametrize(("bits", "known", "known_strict"), [(1, 0, 0), (6, 0, 0), (7, 1, 0), (9, 1, 0), (10, 1, 1)])
def test_all_of_few_bits_are_detected_at_a_rate_that_is_not_claimed(bits, known, known_strict):
    seen = detection([Reading(str(view), 100.0, bits) for view in range(50)], [])
    assert seen.present
    assert [not math.isnan(rate) for rate in (seen.tpr, seen.tpr_strict)] == [known, known_strict]
    chance = detection([Reading(str(view), 100.0 * (view % 2), 1) for view in range(50)], [])
    assert not chance.present


@pytest.mark.parametrize(
    ("bits", "correct", "wrong", "readable"),
    [
        (16, 14, 8, True),
        (16, 13, 8, False),  # as many as chance explains
        (16, 14, 14, False),  # as many as with a wrong key
        (7, 7, 3, True),
        (6, 6, 3, False),  # chance explains any number
        (1, 1, 0, False),
        *((bits, int(Threshold.of(bits, [], 0.01).value), 0, False) for bits in (24, 30, 48, 56, 96, 131)),
    ],
)
def test_embedded_bits_are_readable_only_above_chance_and_wrong_key(bits, correct, wrong, readable):
    message, image = np.ones(bits, bool), np.zeros((4, 4, 3), np.float32)
    write = {"write": lambda _: None}
    wrong_key = SimpleNamespace(bits=message, read_bits=lambda _: np.arange(bits) < wrong, **write)
    read = {"read_bits": lambda _: np.arange(bits) < correct}
    key = SimpleNamespace(bits=message, wrong=lambda _: wrong_key, **read, **write)
    public = SimpleNamespace(scene=lambda _: lambda _: image)
    assert bit_readability([None] * 4, public, key).readable == readable


def test_random_bits_exceed_the_threshold_at_its_rate():
    rng = np.random.default_rng(0)
    message = rng.random(32) < 0.5
    readings = [Reading("", share_correct(rng.random(32) < 0.5, message), 32) for _ in range(20_000)]
    threshold = Threshold.of(32, [], 0.01)
    assert np.mean(np.array([reading.value for reading in readings]) > threshold.value) == pytest.approx(
        threshold.rate, abs=0.002
    )


def test_the_threshold_of_scores_is_that_of_clean_views_and_the_rate_of_few_is_not_claimed():
    clean = np.random.default_rng(0).normal(size=2000).tolist()
    readings = [Reading("a", 3.5, 0), Reading("b", 2.5, 0), Reading("c", 0.0, 0)]
    many, few = detection(readings, clean), detection(readings, clean[:20])
    assert many[2:5] == (pytest.approx(2 / 3), pytest.approx(1 / 3), True)
    assert math.isnan(few.tpr)
    assert math.isnan(few.tpr_strict)
    assert few.present  # two of three views exceed all 20
    assert detection(readings, []).present is None


@pytest.mark.parametrize(
    ("views", "clean", "above", "present"),
    [(5, 199, 0, False), (5, 199, 1, True), (6, 229, 1, False), (6, 229, 2, True)],
)
def test_from_199_clean_views_on_the_threshold_is_their_second_highest(views, clean, above, present):
    """At least 1 of 5 or 6 views exceeds it with probability 1 - C(N, 2) / C(N + V, 2): 0.0485 and 0.0505."""
    readings = [Reading(str(i), clean - 1.5 if i < above else 0.0, 0) for i in range(views)]
    read = detection(readings, [float(i) for i in range(clean)])
    assert (read.tpr, read.present) == (above / views, present)


@pytest.mark.parametrize(("hits", "present"), [(0, False), (1, True), (4, True)])
def test_a_mark_is_present_if_more_views_show_it_than_chance_explains(hits, present):
    readings = [Reading(str(i), 100.0 if i < hits else 50.0, 32) for i in range(4)]
    read = detection(readings, [])
    assert (read.present, read.tpr, read.level) == (present, hits / 4, 50 + 12.5 * hits)


# --- tables and report ------------------------------------------------------------------------------------------------


def outcome(variant: str, level: float, scene_psnr: float = 30.0, asset: str = "room") -> Outcome:
    values = dict.fromkeys(METRICS, 1.0) | {"psnr": scene_psnr}
    read = detection([Reading(view, level, 32) for view in "abcd"], [])
    targets = {"scene": ViewMetrics("scene", "mean", TRUTH, values)}
    return Outcome("vanilla", asset, variant, targets, {"scene": 4}, detections={"mark": read})


@pytest.fixture
def outcomes():
    return with_references(
        [
            outcome("unattacked", 98.0),
            outcome("gspure", 60.0, 29.7),
            outcome("gaussian_noise", 90.0, 29.0),
            outcome("clean", 51.0),
        ]
    )


def test_bits_survive_where_they_are_detected(outcomes):
    rows = {row.variant: row for row in survival(outcomes)}
    assert {name: row.survives for name, row in rows.items()} == {
        "unattacked": True,
        "gspure": False,
        "gaussian_noise": True,
    }
    assert rows["gspure"].message_drop.mean == pytest.approx(38)
    assert rows["gspure"].above_floor.mean == pytest.approx(9)
    assert math.isnan(rows["gspure"].rms_ratio)


@pytest.mark.parametrize("level", [0.1 + 0.2, 0.3])
def test_rounding_alone_is_no_drop(level: float) -> None:
    one = with_references([outcome("unattacked", 0.3, 0.1 + 0.2), outcome("gspure", level, 0.3)])[1]
    assert (one.drop("mark"), one.psnr_drop("scene")) == (0, 0)


def test_bits_enter_the_contest_without_a_score(outcomes):
    rows = [row for row in contest(outcomes, {}) if math.isnan(row.damage)]
    assert SCORE not in {row.quantity for row in rows}
    (drop,) = [row for row in rows if row.quantity == MESSAGE_DROP]
    assert (drop.attack, drop.extraction, drop.difference.mean) == ("gaussian_noise", "mark", pytest.approx(30))


def test_a_mark_that_the_clean_model_shows_too_is_not_judged(tmp_path):
    levels = {"unattacked": 98.0, "gspure": 97.0, "clean": 97.0}
    outcomes = with_references(outcome(name, level) for name, level in levels.items())
    rows = survival(outcomes)
    assert {(row.present, row.survived, row.survives) for row in rows} == {(0, 0, None)}
    (audit,) = audits(outcomes, rows, [])
    assert audit.verdict == "not present"
    write_report(tmp_path / "report.html", outcomes, survivals=rows)
    page = (tmp_path / "report.html").read_text()
    assert "is also detected in the clean model" in page
    assert "survived" not in page.partition("Findings")[0]


def test_a_scene_without_a_clean_model_is_unknown_if_the_detector_finds_the_mark_in_another_clean_model():
    readings = {"unattacked": 98.0, "gspure": 97.0, "clean": 97.0}
    outcomes = [outcome(name, level) for name, level in readings.items()]
    outcomes += [outcome(name, readings[name], asset="hall") for name in ("unattacked", "gspure")]
    outcomes = with_references(outcomes)
    rows = survival(outcomes)
    assert {row.present for row in rows} == {0}
    (audit,) = audits(outcomes, rows, [])
    assert (audit.verdict, audit.in_clean, audit.unknown) == ("not present", 1, 1)


def test_survival_of_a_score_is_qualified_since_the_clean_model_was_not_attacked(outcomes):
    def scored(o):
        detections = {name: read._replace(bits=0) for name, read in o.detections.items()}
        return replace(o, detections=detections)

    raised = outcome("gaussian_noise", 99.0, 29.0)
    found = [o for o in outcomes if o.variant != "gaussian_noise"]
    for last, higher in ((outcomes[2], False), (raised, True)):
        of_scores = with_references(map(scored, [*found, last]))
        for of, qualified in ((of_scores, True), (with_references([*found, last]), False)):
            (audit,) = audits(of, survival(of), [])
            for text in (say("verdict.html.j2", "verdict", audit), say("verdict.html.j2", "answer", audit, 2.0)):
                assert ("those of the unattacked clean model" in text) == qualified
                assert ("The score rose after Gaussian noise" in " ".join(text.split())) == (qualified and higher)


def test_another_scenes_model_with_the_same_mark_is_no_control(outcomes):
    alone = survival(outcomes)
    other = [replace(o, variant="other_scene") for o in outcomes if o.variant == "unattacked"]
    both = with_references([*outcomes, *other])
    assert survival(both) == alone
    (audit,) = audits(both, survival(both), [])
    assert audit.same_mark == audit.scenes
    unmarked = [replace(o, detections={n: d._replace(present=False) for n, d in o.detections.items()}) for o in other]
    assert survival(with_references([*outcomes, *unmarked])) != alone


def test_readings_of_a_scene_are_compared_with_its_own_clean_model_only(outcomes):
    without = [outcome("unattacked", 99.0, asset="hall"), outcome("gspure", 10.0, asset="hall")]
    (row,) = (row for row in survival(with_references([*outcomes, *without])) if row.variant == "gspure")
    (alone,) = (row for row in survival(outcomes) if row.variant == "gspure")
    assert row.detectability == alone.detectability


def test_a_clean_asset_does_not_count_as_a_scene_with_the_mark():
    def of_own(variant, psnr, asset, detections):
        return replace(outcome(variant, 98.0, psnr, asset), reference={}, detections_before={}, detections=detections)

    mark = outcome("gspure", 98.0).detections
    marked = [of_own("unattacked", math.inf, "room", mark), of_own("gspure", 30.0, "room", mark)]
    clean = [of_own("unattacked", math.inf, "bare", {}), of_own("gspure", 40.0, "bare", {})]
    (audit,) = audits([*clean, *marked], survival([*clean, *marked]), [])
    assert [(row.scene.mean, row.scene.scenes) for row in audit.scene_psnr] == [(30.0, 1)]


def test_the_first_pictures_are_of_a_model_with_the_mark():
    clean = SimpleNamespace(lineup="pictures", outcomes=[replace(outcome("gspure", 98.0), detections={})])
    marked, failed = (SimpleNamespace(lineup=shown, outcomes=[outcome("gspure", 98.0)]) for shown in ("pictures", None))
    audit = SimpleNamespace(extraction="mark")
    assert Comparison(audit, [clean, failed, marked], [], None, []).shown is marked
    assert Comparison(audit, [failed, clean], [], None, []).shown is clean
    assert Comparison(audit, [failed], [], None, []).shown is None


@pytest.mark.parametrize(("digest", "fits"), [("1", True), ("2", False)])
def test_the_files_of_a_detector_do_not_change_between_scenes(tmp_path, digest, fits):
    tables = [tmp_path / f"scheme/{scene}/unattacked/detections/mark.csv" for scene in "ab"]
    for table, known in zip(tables, ("1", digest), strict=True):
        write_table(table, Reading, [Reading("view", 75.0, 4)])
        write_record(
            table, inputs={}, settings={"command": f"python read.py --scene {table.parts[-4]}", "file read.py": known}
        )
    with nullcontext() if fits else pytest.raises(InputError, match=r"file read.py: expected 1.* \(read all"):
        read_detections(tables)


def test_the_verdict_is_on_the_mark_if_there_is_no_other_message(outcomes, tmp_path):
    (audit,) = audits(outcomes, survival(outcomes), [])
    assert (audit.extraction, audit.verdict, audit.strongest.variant) == ("mark", "judged", "gspure")
    write_report(tmp_path / "report.html", outcomes, survivals=survival(outcomes), contests=contest(outcomes, {}))
    page = (tmp_path / "report.html").read_text()
    assert "mark (mark) did not survive GSPure, which lowers the mark (mark) by 38 points" in page
    assert "can tell whether a message survived" not in page


def test_a_users_model_is_judged_without_photographs_and_controls():
    infinite = [replace(o, targets={}) for o in (outcome("unattacked", 98.0), outcome("gspure", 90.0))]
    outcomes = with_references(infinite)
    (audit,) = audits(outcomes, survival(outcomes), [])
    assert audit.verdict == "judged"
    assert [row.variant for row in audit.where(True)] == ["gspure"]


def test_a_wrong_key_is_reported_without_a_clean_model(outcomes):
    known = [o for o in outcomes if o.variant != "clean"]
    points = told(with_references([*known, outcome("wrong_key", 50.0)]))[1]
    assert "share of correct bits is" in points["With a wrong key"]


@pytest.mark.parametrize("clean", [True, False])
def test_survival_of_a_mark_that_no_clean_model_was_searched_for_is_qualified(outcomes, clean):
    known = [o for o in outcomes if clean or o.variant != "clean"]
    (audit,) = audits(known, survival(known), [])
    assert audit.verdict == "judged"
    assert audit.unchecked == {"mark": 0 if clean else audit.scenes}
    for text in (say("verdict.html.j2", "verdict", audit), say("verdict.html.j2", "answer", audit, 2.0)):
        assert ("not run on any clean model" in text) == (not clean)


@pytest.mark.parametrize(
    ("readings", "clean"), [([Reading(view, 9.0, 0) for view in "ab"], [1.0, 2.0]), ([Reading("a", 100.0, 4)], [])]
)
def test_a_mark_that_cannot_be_judged_is_not_called_absent(tmp_path, readings, clean):
    """Two clean views allow no verdict on two others, and one view none on 4 bits, though their floor is known."""
    unclear = detection(readings, clean)
    levels = {"unattacked": 9.0, "gspure": 8.0, "clean": 1.5}
    scores = {name: {"mark": unclear._replace(level=level)} for name, level in levels.items()}
    scores["clean"]["mark"] = scores["clean"]["mark"]._replace(present=False)
    outcomes = with_references(replace(outcome(name, 0.0), detections=read) for name, read in scores.items())
    rows = survival(outcomes)
    assert all(row.above_floor for row in rows)
    (audit,) = audits(outcomes, rows, [])
    assert audit.verdict == "no controls"
    write_report(tmp_path / "report.html", outcomes, survivals=rows)
    page = (tmp_path / "report.html").read_text()
    assert "the model has too few views" in page
    assert "is present in 0" not in page


def test_a_scene_with_too_few_views_is_not_counted_among_those_without_the_mark(tmp_path):
    unclear = detection([Reading(view, 9.0, 0) for view in "ab"], [1.0, 2.0])
    clear = detection([Reading(view, 9.0, 0) for view in "abc"], [1.0, 2.0, 3.0])
    outcomes = with_references(
        replace(outcome(name, 0.0), scene=scene, detections={"mark": read._replace(level=level)})
        for scene, read, of_clean in (("s", unclear, unclear), ("t", clear, clear._replace(present=False)))
        for name, level, read in (("unattacked", 9.0, read), ("gspure", 8.0, read), ("clean", 1.5, of_clean))
    )
    rows = survival(outcomes)
    (audit,) = audits(outcomes, rows, [])
    assert (audit.verdict, audit.scenes, audit.unknown, audit.before.present) == ("judged", 2, 1, 1)
    write_report(tmp_path / "report.html", outcomes, survivals=rows)
    assert "present in 1 of 2 scenes (unknown in 1: too few views" in (tmp_path / "report.html").read_text()


def test_a_scene_without_the_mark_counts_neither_in_drops_nor_in_scenes(outcomes):
    values = dict.fromkeys(METRICS, 1.0) | {"psnr": 20.0}
    targets = {"scene": ViewMetrics("scene", "mean", TRUTH, values)}
    unmarked = [replace(o, scene="other", detections={}, targets=targets) for o in outcomes[:3]]
    both = with_references([*outcomes, *unmarked])
    assert survival(both) == survival(outcomes)
    (audit,) = audits(both, survival(both), [])
    assert audit.scenes == 1


def test_the_scenes_psnr_is_listed_for_attacks_only():
    of_own = [replace(outcome(name, 98.0, psnr), reference={}) for name, psnr in (("gspure", 30.0), ("clean", 35.0))]
    (audit,) = audits(of_own, survival(of_own), [])
    assert [row.variant for row in audit.scene_psnr] == ["gspure"]


def test_hidden_bits_are_listed_before_any_detector():
    assert ordered(["alpha", "bits", "message_oracle", "scene"]) == ["scene", "message_oracle", "bits", "alpha"]


OF_PICTURES = (
    "1 dB above the floor",
    "blank images",
    "retrieval",
    "The Score of an attack",
    "compare pixels",
)


def test_a_page_about_a_mark_says_nothing_of_pictures(outcomes, tmp_path):
    shown = attacked("gspure", 1.0, 18.0), attacked("unattacked", 0.0, 0.0)
    for name, chosen in {"mark": outcomes, "both": [*outcomes, *with_references(shown)]}.items():
        write_report(tmp_path / name, chosen, survivals=survival(chosen), contests=contest(chosen, {}))
    mark, both = ((tmp_path / name).read_text() for name in ("mark", "both"))
    assert [text for text in OF_PICTURES if text in mark] == []
    assert [text for text in OF_PICTURES if text not in both] == []


def test_the_reading_of_a_wrong_key_is_compared_and_not_judged(outcomes, tmp_path):
    write_report(tmp_path / "page.html", outcomes, survivals=survival([*outcomes, outcome("wrong_key", 53.0)]))
    assert "share of correct bits is 45 points lower.</span>" in (tmp_path / "page.html").read_text()


def test_tables_have_readings_rates_and_chance(outcomes, tmp_path):
    text = results_markdown(outcomes)
    assert "98.0% (± 0)" in text
    assert "32 bits are 50 ± 8.8% correct" in text
    assert "Survival of the mark (mark)" in conditions_markdown(survival(outcomes), contest(outcomes, {}))
    write_results(tmp_path / "results.csv", outcomes)
    assert [o.detections for o in read_results(tmp_path / "results.csv")] == [o.detections for o in outcomes]


def test_readings_are_collected_with_the_clean_models_as_null(tmp_path):
    files = {"metrics": [], "detections": []}
    for variant, score in (("unattacked", 5.0), ("clean", 0.0)):
        folder = tmp_path / "vanilla" / "room" / variant
        values = dict.fromkeys(METRICS, 1.0)
        write_table(folder / "metrics.csv", ViewMetrics, [ViewMetrics("scene", "a", TRUTH, values)])
        rows = [Reading(f"view_{i:03}", score + i / 200, 0) for i in range(150)] + [Reading("off_path_0", 99.0, 0)]
        write_table(folder / "detections" / "mine.csv", Reading, rows)
        files["metrics"].append(folder / "metrics.csv")
        files["detections"].append(folder / "detections" / "mine.csv")
    marked, clean = collect(**files)
    assert (marked.detections["mine"].tpr, marked.detections["mine"].views) == (1.0, 150)
    assert clean.detections["mine"].tpr <= 0.01
    assert marked.detections_before["mine"] == marked.detections["mine"]


COMMAND = {"command": "read", "message": "0110", "file read": "1"}
READ = {"rows": [Reading("a", 50.0, 4), Reading("b", 100.0, 4)], "settings": COMMAND}


@pytest.mark.parametrize("variant", ["gspure", "clean"])
@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"settings": {"command": "read", "message": "1001"}}, "message: expected 0110"),
        ({"settings": {"command": "read --key 2", "message": "0110"}}, "command: expected read,"),
        ({"settings": COMMAND | {"file read": "2"}}, "file read: expected 1"),
        ({"rows": [Reading("a", 0.5, 0), Reading("b", 0.7, 0)]}, "bits: expected 4"),
        (
            {"rows": [Reading("a", 50.0, 4), Reading("c", 100.0, 4)]},
            "views: expected those in .*others; in only one of the tables: b, c",
        ),
        ({"rows": READ["rows"][:1]}, "views: expected those in .*in only one of the tables: b"),
        ({}, ""),
    ],
)
def test_a_drop_is_not_measured_between_readings_of_different_marks_or_views(tmp_path, variant, change, reason):
    files = []
    for name, read in (("unattacked", READ), (variant, READ | change)):
        files.append(tmp_path / "vanilla" / "room" / name / "detections" / "mine.csv")
        write_table(files[-1], Reading, read["rows"])
        write_record(files[-1], inputs={}, settings=read["settings"])
    is_permitted = not reason or (variant == "clean" and reason.startswith("views"))
    refused = None if is_permitted else pytest.raises(InputError, match=reason)
    with refused or nullcontext():
        read_detections(files)
    with pytest.raises(InputError) if refused else nullcontext():
        read_detections(files[::-1])
    files[1].with_name("mine.csv.json").unlink()
    with refused if refused and "settings" not in change else nullcontext():
        read_detections(files)


@pytest.mark.parametrize("other", [-9.0, 0.0, 9.0, 99.0])
@pytest.mark.parametrize("views", [2, 4, 99, 250])
@pytest.mark.parametrize("place", ["planted/a", "vanilla/b", "vanilla/a@1"])
def test_models_of_the_same_run_change_no_detection(tmp_path, other, views, place):
    """Neither its rates nor the verdict: scores of other scenes, schemes and image sizes are not exchangeable."""

    def read(model, variant, score):
        file = tmp_path / model / variant / "detections" / "mine.csv"
        write_table(file, Reading, [Reading(f"view_{i}", score + i % 4, 0) for i in range(views)])
        return file

    files = [read("vanilla/a", "unattacked", 1.5), read("vanilla/a", "gspure", 9.0), read("vanilla/a", "clean", 0.0)]
    alone = read_detections(files)
    together = read_detections([*files, read(place, "unattacked", other), read(place, "clean", other)])
    assert {key: together[key] for key in alone} == alone
    (marked,) = alone["vanilla", "a", "gspure"].values()
    assert (marked.present, math.isnan(marked.tpr)) == (None if views < 3 else True, views < 99)


def test_a_model_without_a_clean_control_borrows_none(tmp_path):
    files = [tmp_path / "vanilla" / name / "detections" / "mine.csv" for name in ("a/gspure", "b/gspure", "b/clean")]
    for file in files:
        write_table(file, Reading, [Reading(f"view_{i}", 9.0 * ("gspure" in str(file)) + i, 0) for i in range(4)])
    known = read_detections(files)
    assert [known["vanilla", scene, "gspure"]["mine"].present for scene in "ab"] == [None, True]


@pytest.mark.parametrize(
    ("marked", "clean", "known"), [(1, 18, 0), (1, 19, 1), (2, 4, 0), (2, 5, 1), (3, 2, 0), (3, 3, 1)]
)
def test_too_few_views_for_a_verdict_on_scores_leave_it_unknown(marked, clean, known):
    read = detection([Reading(str(i), 99.0, 0) for i in range(marked)], [float(i) for i in range(clean)])
    assert read.present == (True if known else None)


@pytest.mark.parametrize(("marked", "clean"), [(2, 5), (3, 3), (4, 4), (5, 3)])
def test_of_all_orders_of_exchangeable_scores_at_most_one_in_twenty_is_a_mark(marked, clean):
    scores = {*range(marked + clean)}
    present = [
        detection([Reading("", float(score), 0) for score in chosen], [*scores - {*chosen}]).present
        for chosen in combinations(scores, marked)
    ]
    assert 0 < np.mean(present) <= 0.05


def test_a_failed_detector_is_named_with_its_reason_and_leaves_the_metrics(tmp_path):
    folder = tmp_path / "vanilla" / "room" / "gspure"
    values = dict.fromkeys(METRICS, 1.0)
    write_table(folder / "metrics.csv", ViewMetrics, [ViewMetrics("scene", "a", TRUTH, values)])
    log = tmp_path / "detect_mine.log"
    Failure("detect_mark", "no weights", str(log), "run", [str(folder / "detections" / "mine.csv")]).write()
    outcomes = collect([folder / "metrics.csv"], failures=[status_of(log)])
    assert outcomes[0].undetected == {"mine": "no weights"}
    assert "Failed: mine of GSPure on Own model, room (no weights)" in results_markdown(outcomes)
    write_results(tmp_path / "results.csv", outcomes)
    assert read_results(tmp_path / "results.csv")[0].undetected == {"mine": "no weights"}
    assert read_results(tmp_path / "results.csv")[0].failure == ""
    rows = [*csv.DictReader((tmp_path / "results.csv").read_text().splitlines())]
    assert [row["failure"] for row in rows] == ["", "no weights"]


def test_a_reading_needs_a_view_on_the_camera_path(tmp_path):
    path = tmp_path / "vanilla" / "room" / "unattacked" / "detections" / "mine.csv"
    write_table(path, Reading, [Reading("off_path_0", 1.0, 0)])
    write_table(
        path.parents[1] / "metrics.csv", ViewMetrics, [ViewMetrics("scene", "a", TRUTH, dict.fromkeys(METRICS, 1.0))]
    )
    with pytest.raises(InputError, match="on the camera path"):
        collect([path.parents[1] / "metrics.csv"], detections=[path])
