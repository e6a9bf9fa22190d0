"""Outcomes of variants, from their files to the table and back: identities, drops, effects, titles and failures."""

import csv
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gspure.arrays import save_array
from gspure.codec import plain
from gspure.errors import InputError
from gspure.evaluation.collecting import MESSAGE_ROWS, collect
from gspure.evaluation.identity import Condition, ModelId
from gspure.evaluation.outcomes import UNCHANGED, Outcome, extractions, ordered, with_references
from gspure.evaluation.paper import Check, Claim, beside, check_claims, mean_psnr, read_rows, score
from gspure.evaluation.plan import Control, ModelPlan
from gspure.evaluation.results import read_results, write_results
from gspure.evaluation.summary import specificity, summarize
from gspure.evaluation.survival import survival
from gspure.evaluation.verdict import VERDICT, Applied, AttackRecord, StrengthValue
from gspure.files import write_json, write_text
from gspure.metrics.comparison import read_metrics, write_metrics
from gspure.metrics.detection import Detection, detection
from gspure.metrics.image_metrics import DAMAGE_TOLERANCE
from gspure.metrics.readings import Reading
from gspure.metrics.retrieval import Retrieval
from gspure.metrics.targets import MODEL_BITS
from tests.contest_cases import BEFORE, attacked, measured, model_plan, outcome, write_model


@pytest.mark.parametrize(
    ("named", "key", "title"),
    [
        (ModelId("gs_hider", "room"), "gs_hider/room", "GS-Hider, room"),
        (ModelId("gs_hider", "room", 2), "gs_hider/room@2", "GS-Hider, room, repetition 2"),
        (Condition("vanilla"), "vanilla", "Own model"),
        (Condition("gs_hider", "own", "both"), "gs_hider-own-both", "GS-Hider, own poses"),
        (Condition("gs_hider", "shared", "scene"), "gs_hider-shared-scene", "GS-Hider, shared poses, scene's points"),
    ],
)
def test_models_and_conditions_have_a_folder_and_a_title(named: ModelId | Condition, key: str, title: str) -> None:
    folder = Path("results") / named.key if isinstance(named, Condition) else named.folder
    assert (folder, named.title) == (Path("results") / key, title)


def mark(level: float) -> Detection:
    return detection([Reading(view, level, 32) for view in "abcd"], [])


NOISE = attacked("noise", 1.5, 6.0)
MISSED = attacked("noise@1dB", 0.75, 2.0, strength=StrengthValue("sigma", 0.123456), search_damage=0.5)
FAILED = outcome("crop", failure="no memory", detector_errors={"mark": "too slow"})
EXACT = {"scene": measured("scene", math.inf)}


def test_a_drop_is_the_level_before_minus_that_after_and_a_score_their_difference() -> None:
    assert (NOISE.psnr_drop("scene"), NOISE.drop("message"), NOISE.score) == (1.5, 6.0, 4.5)
    assert NOISE.drops("scene")["ssim"] == 0.0
    control = attacked("wrong_key", 0.0, 6.0)
    assert control.is_control
    assert math.isnan(control.score)


@pytest.mark.parametrize(
    ("o", "target"),
    [
        (replace(NOISE, targets=EXACT), "scene"),
        (replace(NOISE, before=replace(outcome("unattacked"), targets=EXACT)), "scene"),
        (replace(NOISE, before=None), "scene"),
        (NOISE, "message_adaptive"),
    ],
    ids=["to an exact image", "from an exact image", "without a reference", "without an image"],
)
def test_a_drop_is_unknown(o: Outcome, target: str) -> None:
    assert math.isnan(o.psnr_drop(target))


def test_without_photographs_the_drop_is_the_nominal_one() -> None:
    before = outcome("unattacked", targets=BEFORE, nominal={"scene": 0.25})
    o = replace(NOISE, nominal={"scene": 2.25}, before=before)
    assert (o.psnr_drop("scene"), o.psnr_drop("message")) == (2.0, 6.0)


def test_the_drop_of_a_detector_is_that_of_its_mean_reading() -> None:
    levels = {"unattacked": 90.0, "noise": 60.0}
    outcomes = [outcome(name, targets={"scene": 30.0}, detections={"mark": mark(n)}) for name, n in levels.items()]
    assert with_references(outcomes)[1].drop("mark") == 30.0


@pytest.mark.parametrize(
    ("change", "affects", "contradicts", "reaches"),
    [
        (0.0, {"message": False}, False, False),
        (UNCHANGED, {"message": False}, False, False),
        (2 * UNCHANGED, {"message": False}, True, True),
        (6.0, {"message": True}, False, True),
        (6.0, {}, False, None),
    ],
)
def test_a_change_beyond_rounding_contradicts_that_an_extraction_is_unaffected(change, affects, contradicts, reaches):
    before = outcome("unattacked", targets={"message": change})
    _, o = with_references([before, outcome("noise", targets={"message": 0.0}, affects=affects)])
    assert o.contradicts("message") is contradicts
    assert o.reaches("message") is reaches


@pytest.mark.parametrize(
    ("o", "name", "expected"),
    [
        (MISSED, "strength_text", "sigma=0.1235, 0.50 dB reached"),
        (replace(MISSED, search_damage=1.0), "strength_text", "sigma=0.1235"),
        (replace(MISSED, wanted=math.nan), "strength_text", "sigma=0.1235"),
        (replace(MISSED, strength=None), "strength_text", ""),
        (MISSED, "damage", 0.75),
        (replace(MISSED, targets=EXACT), "damage", 0.5),
        (replace(MISSED, targets=EXACT, search_damage=1 + DAMAGE_TOLERANCE / 2), "damage", 1.0),
        (MISSED, "title", "noise, 1 dB"),
        (attacked("gaussian_noise", 1.0, 2.0), "title", "Gaussian noise"),
        (FAILED, "failures", {"crop": "no memory", "mark of crop": "too slow"}),
        (NOISE, "failures", {}),
    ],
)
def test_an_outcome_names_its_strength_and_damage_and_why_numbers_are_missing(o, name, expected) -> None:
    assert getattr(o, name) == expected


def test_an_image_without_structure_is_flat() -> None:
    assert replace(NOISE, targets={"message": measured("message", 10.0, others=0.0)}).is_flat("message")
    assert not NOISE.is_flat("message")
    assert not NOISE.is_flat("message_adaptive")


def test_targets_are_ordered_from_the_scene_to_detectors() -> None:
    names = ["mark", "model_bits", "bits", "message_oracle", "message", "a", "scene"]
    assert ordered(names) == ["scene", "message", "message_oracle", "bits", "model_bits", "a", "mark"]
    o = outcome("noise", targets={"scene": 30.0, "message": 10.0}, unreadable={"message_x": "no"})
    assert extractions([o, replace(o, detections={"mark": mark(60.0)})]) == ["message", "message_x", "mark"]


def test_gspure_on_a_clean_model_is_compared_with_that_model() -> None:
    levels = {"unattacked": 30.0, "clean": 29.0, "clean_gspure": 28.5}
    outcomes = [outcome(name, targets={"scene": level}) for name, level in levels.items()]
    elsewhere = outcome("unattacked", "vault", targets={"scene": 20.0})
    drops = [o.psnr_drop("scene") for o in with_references([*outcomes, elsewhere])]
    assert drops == [0.0, 1.0, 0.5, 0.0]


def table_rows() -> list[Outcome]:
    """Outcomes with a value in every column."""
    where = {"protocol": "own", "initialization": "scene", "run": "abc"}
    targets = {"scene": 30.0, "message": 28.0}
    known = {
        "pruned_share": 0.5,
        "precision": 0.25,
        "recall": 0.75,
        "strength": StrengthValue("sigma", 0.5),
        "search_damage": 1.03,
        "affects": {"message": True, "mark": False},
        "identical": {"scene": 0, "message": 2},
        "retrieval": {"message": Retrieval(0.5, 0.75, 0.25, 4, 17)},
        "detections": {"mark": mark(60.0)},
    }
    noise = outcome("noise@1dB", targets={"scene": 29.0, "message": 20.0}, **where, **known)
    of_renders = {name: measured(name, level, reference="render") for name, level in targets.items()}
    repeated = outcome("noise", "vault", 1, targets=targets, nominal={"scene": 0.5, "message": 2.0})
    return [
        outcome("unattacked", targets=targets, detections={"mark": mark(90.0)}, **where),
        noise,
        outcome("crop", failure="not run", **where),
        outcome("gof", targets=targets, detector_errors={"mark": "too slow"}, **where),
        outcome("distil", targets={"scene": 28.0}, unreadable={"message": "removed"}, **where),
        outcome("unattacked", "vault", 1, targets=targets),
        replace(repeated, targets=of_renders),
    ]


def comparable(o: Outcome) -> Outcome:
    """Return an outcome without what a table leaves out, and without NaN, which differs from itself."""
    unknown = {name: None for name, value in vars(o).items() if isinstance(value, float) and math.isnan(value)}
    detections = {name: str(read) for name, read in o.detections.items()}
    return replace(o, before=None, nominal={}, **unknown, detections=detections)


def written(folder: Path, outcomes: Sequence[Outcome], attacks: Mapping[str, Sequence[str]]) -> list[dict[str, str]]:
    """Write the table, and return its cells."""
    write_results(folder / "results.csv", outcomes, attacks)
    return [*csv.DictReader((folder / "results.csv").read_text().splitlines())]


def test_a_table_is_read_back_with_every_number_and_reason(tmp_path: Path) -> None:
    outcomes = with_references(table_rows())
    written(tmp_path, outcomes, {"noise sweep": ["noise@1dB", "noise"], "crop": ["crop"]})
    copies, attacks = read_results(tmp_path / "results.csv")
    assert [*map(comparable, copies)] == [*map(comparable, outcomes)]
    assert attacks["noise sweep"] == ["noise@1dB", "noise"]
    assert attacks[""] == ["unattacked", "gof", "distil"]


def test_nominal_drops_of_a_table_are_those_of_renders(tmp_path: Path) -> None:
    rendered = {"scene": measured("scene", 40.0, reference="render")}
    nominal = {"unattacked": 0.25, "noise": 1.0}
    rows = [outcome(name, targets={"scene": 40.0}, nominal={"scene": drop}) for name, drop in nominal.items()]
    written(tmp_path, with_references([replace(o, targets=rendered) for o in rows]), {})
    copies, _ = read_results(tmp_path / "results.csv")
    assert [o.nominal for o in copies] == [{"scene": 0.0}, {"scene": 0.75}]
    assert copies[1].psnr_drop("scene") == 0.75


def test_the_score_of_a_row_is_that_of_its_extraction_or_else_of_the_message(tmp_path: Path) -> None:
    before = outcome("unattacked", targets={"scene": 30.0, "message": 28.0, "message_adaptive": 26.0})
    after = outcome("noise", targets={"scene": 29.0, "message": 20.0, "message_adaptive": 24.0})
    rows = written(tmp_path, with_references([before, after]), {})
    scores = {row["target"]: float(row["score"]) for row in rows if row["variant"] == "noise"}
    assert scores == {"scene": 7.0, "message": 7.0, "message_adaptive": 1.0}


def test_a_model_without_readings_is_no_scene_where_others_are_read() -> None:
    marked = outcome("unattacked", targets={"scene": 30.0}, detections={"mark": mark(90.0)})
    clean = outcome("unattacked", "clean", targets={"scene": 20.0})
    failed = outcome("unattacked", "vault", failure="not run")
    for outcomes, mean in (([marked, clean], 30.0), ([clean, failed], 20.0), ([clean], 20.0)):
        (row,) = summarize(outcomes)
        assert row.scene is not None
        assert (row.scene.mean, row.scene.scenes) == (mean, 1)


ATTACKS = {"gspure": (0.055, 0.5), "noise": (0.2, 0.02)}
MODEL = "sis/room"


@pytest.fixture
def plan(tmp_path: Path) -> ModelPlan:
    """The plan of a model whose results are there."""
    return write_model(tmp_path, MODEL, ATTACKS)


def by_variant(results: Path, plan: ModelPlan) -> dict[str, Outcome]:
    return {o.variant: o for o in collect(results, [plan])}


def test_every_variant_and_control_is_an_outcome_in_the_order_of_the_plan(tmp_path, plan) -> None:
    found = by_variant(tmp_path, plan)
    assert [*found] == ["unattacked", "gspure", "noise", "clean", "black"]
    gspure = found["gspure"]
    assert (gspure.scheme, gspure.scene, gspure.seed, gspure.condition) == ("sis", "room", 0, ("sis", "shared", "both"))
    assert gspure.views == {"scene": 3, "message": 3}
    assert gspure.before.targets == found["unattacked"].targets
    assert (gspure.strength, gspure.affects) == (("sigma", 0.1), {"message": True})


def test_outcomes_are_sorted_by_model_with_the_unattacked_first(tmp_path: Path) -> None:
    models = [model_plan(name, ("crop", "unattacked", "blur"), ("clean",)) for name in ("b/room", "a/vault", "a/room")]
    repetition = replace(models[2], id=ModelId("a", "room", 1))
    outcomes = collect(tmp_path, [repetition, *models])
    order = [(o.scheme, o.scene, o.seed) for o in outcomes[::4]]
    assert order == [("a", "room", 0), ("a", "room", 1), ("a", "vault", 0), ("b", "room", 0)]
    assert [o.variant for o in outcomes[:4]] == ["unattacked", "crop", "blur", "clean"]
    assert {o.failure for o in outcomes} == {"not run"}


def test_masks_and_known_rows_give_shares_precision_and_recall(tmp_path, plan) -> None:
    folder = tmp_path / MODEL
    save_array(folder / "gspure" / "prune_mask.npy", np.array([1, 1, 1, 1, 0, 0, 0, 0], bool))
    assert by_variant(tmp_path, plan)["gspure"].pruned_share == 0.5
    save_array(folder / "key" / MESSAGE_ROWS, np.array([1, 0, 0, 0, 1, 0, 0, 0], bool))
    gspure = by_variant(tmp_path, plan)["gspure"]
    assert (gspure.precision, gspure.recall) == (0.25, 0.5)
    save_array(folder / "key" / MESSAGE_ROWS, np.zeros(3, bool))
    with pytest.raises(InputError, match=MESSAGE_ROWS):
        by_variant(tmp_path, plan)


def test_an_unreadable_message_survives_in_no_outcome_and_in_no_copy_of_it(tmp_path, plan) -> None:
    folder = tmp_path / MODEL / "gspure"
    verdict = AttackRecord(Applied(affects={"message": True}, removed="no such format"))
    write_json(folder / VERDICT, plain(verdict))
    rows = read_metrics(folder / "metrics.csv")
    write_metrics(folder / "metrics.csv", [row for row in rows if row.target == "scene"])
    variants = (plan.variants[0], *(replace(job, bits=(MODEL_BITS,)) for job in plan.variants[1:]))
    outcomes = collect(tmp_path, [replace(plan, variants=variants)])
    written(tmp_path, outcomes, {})
    again, _ = read_results(tmp_path / "results.csv")
    assert survival(again) == survival(outcomes)
    gspure = next(row for row in survival(again) if row.variant == "gspure")
    assert (gspure.present, gspure.survived, gspure.message_drop) == (1, 0, None)
    assert again[1].unreadable == dict.fromkeys(("message", MODEL_BITS), "removed: no such format")
    assert not again[1].failures


def test_a_clean_model_is_compared_with_itself_before_gspure(tmp_path) -> None:
    plan = write_model(tmp_path, MODEL, {**ATTACKS, "clean_gspure": (0.3, 0.6)})
    save_array(tmp_path / MODEL / "clean_gspure" / "prune_mask.npy", np.array([True, False, False, False]))
    clean = replace(plan.variants[-1], case=Control("clean_gspure"))
    plan = replace(plan, variants=plan.variants[:-1], controls=(*plan.controls, clean))
    found = by_variant(tmp_path, plan)
    (row,) = specificity([*found.values()])
    assert row.clean_pruned.mean == 0.25
    assert row.clean_scene_drop.mean == found["clean"].level("scene") - found["clean_gspure"].level("scene")
    assert row.scene_drop.mean == found["gspure"].psnr_drop("scene")


def test_a_missing_variant_names_the_last_line_of_its_failed_log(tmp_path, plan) -> None:
    def reason_after(name: str, text: str, age: float) -> str:
        file = tmp_path / "logs" / MODEL / name
        write_text(file, text)
        os.utime(file, (1e9 - age, 1e9 - age))
        return by_variant(tmp_path, plan)["noise"].failure

    (tmp_path / MODEL / "noise" / "metrics.csv").unlink()
    assert by_variant(tmp_path, plan)["noise"].failure == "not run"
    assert reason_after("embed.log", "gspure embed: no memory\n", 9) == "gspure embed: no memory"
    expected = "gspure attack: sigma: expected a number"
    assert reason_after("noise/attack.log", f"device 0\n{expected}\n\n", 5) == expected
    assert reason_after("noise/render.log", "render: 8 done in 0.2 s\n", 0) == expected
    found = by_variant(tmp_path, plan)
    assert (found["noise"].targets, found["gspure"].failures) == ({}, {})
    (row,) = (row for row in written(tmp_path, [*found.values()], {}) if row["variant"] == "noise")
    assert (row["failure"], row["target"], row["psnr"]) == (expected, "", "")


def test_the_run_is_known_and_two_runs_in_one_model_are_warned_of(tmp_path, plan, capsys) -> None:
    folder = tmp_path / MODEL
    write_json(folder / "public" / "provenance.json", {"run": "abc"})
    write_json(folder / "clean" / "public" / "provenance.json", {"run": "of the clean model"})
    assert {o.run for o in by_variant(tmp_path, plan).values() if o.variant != "clean"} == {"abc"}
    assert "runs" not in capsys.readouterr().err
    write_json(folder / "noise" / "provenance.json", {"run": "def"})
    collect(tmp_path, [plan])
    assert "room: results of 2 runs: abc, def" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("relation", "recomputed", "holds"),
    [
        *[("=", 1.015, True), ("=", 0.985, True), ("=", 1.025, False), ("=", 0.975, False)],
        *[("<", 0.5, True), ("<", 1.0, False), ("<", 1.5, False)],
    ],
)
def test_a_claim_holds_within_rounding_or_below_its_bound(relation: str, recomputed: float, holds: bool) -> None:
    claim = Claim("Table 1", "words", "score", "gs_hider", "gspure", "", relation, 1.0)
    assert Check(claim, recomputed).holds is holds


def test_the_papers_numbers_that_do_not_follow_from_its_tables() -> None:
    failed: dict[str, list[float]] = {}
    for check in check_claims(read_rows()):
        if not check.holds:
            failed.setdefault(check.claim.place, []).append(check.claim.value)
    assert failed == {
        "Table 1": [15.21, 5.03],
        "Table 3": [25.62, 10.19],
        "Abstract": [16.34, 1.0],
        "Original Scene Fidelity": [9.68, 2.21],
        "Watermark Purification Effectiveness": [5.44, 12.97, 4.39],
    }


def test_claims_of_ablations_name_the_column_of_their_table() -> None:
    words = [check.claim.words for check in check_claims(read_rows()) if check.claim.place in ("Table 2", "Table 3")]
    columns = [text.rpartition(", ")[2] for text in words]
    assert columns == ["GS-Hider PSNR", "SecureGS PSNR", "Scene PSNR", "Message PSNR"]


def test_the_papers_score_of_an_attack_is_that_of_its_means() -> None:
    printed = read_rows()
    means = mean_psnr(printed)
    scores = {(row.condition.scheme, row.variant): row.paper_score for row in beside(printed)}
    assert scores == {key: pytest.approx(score(means, *key)) for key in scores}
