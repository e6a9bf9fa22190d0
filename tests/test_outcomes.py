"""Outcomes of variants from their files: identities, drops, effects, titles and failures; and the paper's numbers."""

import math
import os
from dataclasses import replace
from pathlib import Path

import pytest

from gspure.codec import plain
from gspure.evaluation.attack_record import StrengthValue
from gspure.evaluation.collecting import collect
from gspure.evaluation.evidence import EVIDENCE, JobEvidence, SceneChange
from gspure.evaluation.identity import Condition, ModelId
from gspure.evaluation.outcomes import UNCHANGED, Outcome, extractions, ordered, with_references
from gspure.evaluation.paper import Check, Claim, beside, check_claims, mean_psnr, read_rows, score
from gspure.evaluation.plan import ModelPlan
from gspure.files import write_json, write_text
from gspure.metrics.bit_evidence import bit_evidence
from gspure.metrics.csv_tables import write_table
from gspure.metrics.detection import Detection, detection
from gspure.metrics.readings import Reading
from gspure.metrics.targets import BITS
from tests.outcome_cases import attacked, measured, model_plan, outcome, write_model


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
    return detection([Reading(view, level, 32, "") for view in "abcd"], [])


NOISE = attacked("noise", 1.5, 6.0)
MISSED = attacked("noise@1dB", 0.75, 2.0, strength=StrengthValue("sigma", 0.123456), search_damage=0.5)
FAILED = outcome("crop", failure="no memory", detector_errors={"mark": "too slow"})
EXACT = {"scene": measured("scene", math.inf)}
RENDERED = replace(NOISE, change=SceneChange(None, 41.0, 0.25))


def test_damage_needs_photographs_and_fidelity_is_known_without_them() -> None:
    assert (NOISE.damage, NOISE.psnr_drop("message")) == (1.5, 6.0)
    assert (RENDERED.fidelity, RENDERED.coverage_lost) == (41.0, 0.25)
    assert math.isnan(RENDERED.damage)
    assert math.isnan(NOISE.fidelity)
    assert replace(RENDERED, change=SceneChange(None, None, 0.0)).fidelity == math.inf


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
        (MISSED, "title", "noise, 1 dB"),
        (attacked("gaussian_noise", 1.0, 2.0), "title", "Gaussian noise"),
        (FAILED, "failures", {"crop": "no memory", "mark of crop": "too slow"}),
        (NOISE, "failures", {}),
    ],
)
def test_an_outcome_names_its_strength_and_damage_and_why_numbers_are_missing(o, name, expected) -> None:
    assert getattr(o, name) == expected


def test_targets_are_ordered_from_the_scene_to_detectors() -> None:
    names = ["mark", "model_bits", "bits", "message_other", "message", "a", "scene"]
    assert ordered(names) == ["scene", "message", "message_other", "bits", "model_bits", "a", "mark"]
    o = outcome("noise", targets={"scene": 30.0, "message": 10.0}, unreadable={"message_x": "no"})
    assert extractions([o, replace(o, detections={"mark": mark(60.0)})]) == ["message", "message_x", "mark"]


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
    assert [*found] == ["unattacked", "gspure", "noise", "clean"]
    gspure = found["gspure"]
    assert (gspure.scheme, gspure.scene, gspure.seed, gspure.condition) == ("sis", "room", 0, ("sis", "shared", "both"))
    assert gspure.views == {"scene": 3, "message": 3}
    assert gspure.before.targets == found["unattacked"].targets
    assert (gspure.strength, gspure.affects) == (("sigma", 0.1), {"message": True})


def test_the_bits_of_a_control_without_metrics_are_read(tmp_path, plan) -> None:
    wrong_key = replace(plan.controls[0], variant="wrong_key", compared=(), bit_targets=(BITS,))
    folder = tmp_path / MODEL / "wrong_key"
    write_table(folder / "detections" / "bits.csv", Reading, [Reading("view_0", 50.0, 2, "01")])
    bits = {"bits": bit_evidence([Reading("view_0", 50.0, 2, "01")], "00")}
    write_json(folder / EVIDENCE, plain(JobEvidence(bits=bits)))
    o = by_variant(tmp_path, replace(plan, controls=(wrong_key,)))["wrong_key"]
    assert (o.targets, o.bits, [*o.detections]) == ({}, bits, ["bits"])


def test_outcomes_are_sorted_by_model_with_the_unattacked_first(tmp_path: Path) -> None:
    models = [model_plan(name, ("crop", "unattacked", "blur"), ("clean",)) for name in ("b/room", "a/vault", "a/room")]
    repetition = replace(models[2], id=ModelId("a", "room", 1))
    outcomes = collect(tmp_path, [repetition, *models])
    order = [(o.scheme, o.scene, o.seed) for o in outcomes[::4]]
    assert order == [("a", "room", 0), ("a", "room", 1), ("a", "vault", 0), ("b", "room", 0)]
    assert [o.variant for o in outcomes[:4]] == ["unattacked", "crop", "blur", "clean"]
    assert {o.failure for o in outcomes} == {"not run"}


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
