"""A folder of results as outcomes: what is there, why the rest is missing, and the table of both."""

import csv
import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gspure.arrays import save_array
from gspure.codec import plain
from gspure.errors import InputError
from gspure.evaluation.collecting import MESSAGE_ROWS, collect
from gspure.evaluation.plan import Control, ModelPlan
from gspure.evaluation.results import read_results, write_results
from gspure.evaluation.summary import specificity
from gspure.evaluation.survival import survival
from gspure.evaluation.verdict import VERDICT, Applied, AttackRecord
from gspure.files import write_json, write_text
from gspure.metrics.comparison import read_metrics, write_metrics
from tests.contest_cases import write_model

ATTACKS = {"gspure": (0.055, 0.5), "noise": (0.2, 0.02)}
MODEL = "sis/room"


@pytest.fixture
def plan(tmp_path: Path) -> ModelPlan:
    return write_model(tmp_path, MODEL, ATTACKS)


def by_variant(results: Path, plan: ModelPlan):
    return {o.variant: o for o in collect(results, [plan])}


def table(results: Path, plan: ModelPlan) -> list[dict[str, str]]:
    write_results(results / "results.csv", collect(results, [plan]), {})
    return [*csv.DictReader((results / "results.csv").read_text().splitlines())]


def test_every_variant_and_control_is_an_outcome_in_the_order_of_the_plan(tmp_path, plan) -> None:
    found = by_variant(tmp_path, plan)
    assert [*found] == ["unattacked", "gspure", "noise", "clean", "black"]
    gspure = found["gspure"]
    assert (gspure.scheme, gspure.scene, gspure.seed, gspure.condition) == ("sis", "room", 0, ("sis", "shared", "both"))
    assert gspure.views == {"scene": 3, "message": 3}
    assert gspure.before.targets == found["unattacked"].targets
    drop = found["unattacked"].level("message") - gspure.level("message")
    assert gspure.psnr_drop("message") == pytest.approx(drop)
    assert gspure.score == pytest.approx(drop - gspure.psnr_drop("scene"))
    assert math.isnan(found["clean"].score)
    assert (gspure.strength, gspure.affects) == (("sigma", 0.1), {"message": True})


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


def test_a_table_is_read_back_into_outcomes_with_the_same_drops_and_survival(tmp_path, plan) -> None:
    verdict = AttackRecord(Applied(affects={"message": True}, removed="no such format"))
    write_json(tmp_path / MODEL / "gspure" / VERDICT, plain(verdict))
    rows = [row for row in read_metrics(tmp_path / MODEL / "gspure" / "metrics.csv") if row.target == "scene"]
    write_metrics(tmp_path / MODEL / "gspure" / "metrics.csv", rows)
    outcomes = collect(tmp_path, [plan])
    write_results(tmp_path / "results.csv", outcomes, {"noise": ["noise"]})
    again, attacks = read_results(tmp_path / "results.csv")
    assert attacks["noise"] == ["noise"]
    np.testing.assert_array_equal(*([[*o.drops("scene").values()] for o in of] for of in (again, outcomes)))
    assert survival(again) == survival(outcomes)
    gspure = next(row for row in survival(again) if row.variant == "gspure")
    assert (gspure.present, gspure.survived, gspure.message_drop) == (1, 0, None)
    assert again[1].unreadable == {"message": "removed: no such format"}


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


def log(results: Path, name: str, text: str, age: float = 0) -> None:
    file = results / "logs" / MODEL / name
    write_text(file, text)
    os.utime(file, (1e9 - age, 1e9 - age))


def test_a_missing_variant_names_the_last_line_of_its_failed_log(tmp_path, plan) -> None:
    (tmp_path / MODEL / "noise" / "metrics.csv").unlink()
    assert by_variant(tmp_path, plan)["noise"].failure == "not run"
    log(tmp_path, "embed.log", "gspure embed: no memory\n", age=9)
    assert by_variant(tmp_path, plan)["noise"].failure == "gspure embed: no memory"
    log(tmp_path, "noise/attack.log", "device 0\ngspure attack: sigma: expected a number\n\n", age=5)
    log(tmp_path, "noise/render.log", "render: 8 done in 0.2 s\n")
    noise = by_variant(tmp_path, plan)["noise"]
    assert noise.failure == "gspure attack: sigma: expected a number"
    assert (noise.targets, noise.failures) == ({}, {"noise": noise.failure})
    assert not by_variant(tmp_path, plan)["gspure"].failures
    (row,) = (row for row in table(tmp_path, plan) if row["variant"] == "noise")
    assert (row["failure"], row["target"], row["psnr"]) == (noise.failure, "", "")


def test_the_run_is_a_column_and_two_runs_in_one_model_are_warned_of(tmp_path, plan, capsys) -> None:
    folder = tmp_path / MODEL
    write_json(folder / "public" / "provenance.json", {"run": "abc"})
    write_json(folder / "clean" / "public" / "provenance.json", {"run": "of the clean model"})
    assert {row["run"] for row in table(tmp_path, plan) if row["variant"] != "clean"} == {"abc"}
    assert "runs" not in capsys.readouterr().err
    write_json(folder / "noise" / "provenance.json", {"run": "def"})
    collect(tmp_path, [plan])
    assert "room: results of 2 runs: abc, def" in capsys.readouterr().err
