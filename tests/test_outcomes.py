"""Outcomes of variants from their files: identities, drops, effects, titles and failures."""

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
from gspure.evaluation.outcomes import UNCHANGED, Outcome, with_references
from gspure.evaluation.plan import ModelPlan
from gspure.files import write_json, write_text
from gspure.metrics.bit_evidence import bit_evidence
from gspure.metrics.csv_tables import write_table
from gspure.metrics.readings import Reading
from gspure.metrics.targets import BITS
from tests.outcome_cases import attacked, measured, outcome, write_model


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


def test_an_outcome_names_its_strength_if_it_missed_the_damage_and_why_numbers_are_missing() -> None:
    assert (MISSED.strength_text, MISSED.damage) == ("sigma=0.1235, 0.50 dB reached", 0.75)
    assert replace(MISSED, search_damage=1.0).strength_text == "sigma=0.1235"
    assert FAILED.failures == {"crop": "no memory", "mark of crop": "too slow"}
    assert NOISE.failures == {}


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
    assert math.isnan(gspure.wanted + gspure.search_damage)


def test_the_bits_of_a_control_without_metrics_are_read(tmp_path, plan) -> None:
    wrong_key = replace(plan.controls[0], variant="wrong_key", compared=(), bit_targets=(BITS,))
    folder = tmp_path / MODEL / "wrong_key"
    write_table(folder / "detections" / "bits.csv", Reading, [Reading("view_0", 50.0, 2, "01")])
    bits = {"bits": bit_evidence([Reading("view_0", 50.0, 2, "01")], "00")}
    write_json(folder / EVIDENCE, plain(JobEvidence(bits=bits)))
    o = by_variant(tmp_path, replace(plan, controls=(wrong_key,)))["wrong_key"]
    assert (o.targets, o.bits, [*o.detections]) == ({}, bits, ["bits"])


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
