"""The paper's printed numbers: complete, consistent with what the text says of them, and recomputed correctly.

They are references. Nothing here compares our own results with them.
"""

import csv
import re
from itertools import product

import numpy as np
import pytest

from gspure.cli import main
from gspure.evaluation.paper import (
    ATTACKS,
    SCHEMES,
    TARGETS,
    beside,
    check_claims,
    mean_psnr,
    psnr_by_scene,
    read_rows,
    score,
    score_interval,
)
from gspure.evaluation.survival import Survival, survival
from gspure.metrics.csv_tables import write_table
from tests.contest_cases import benchmark

VARIANTS = ("unattacked", *ATTACKS)
PRINTED = read_rows()
CHECKS = check_claims(PRINTED)
NINE = {"bicycle", "bonsai", "room", "flowers", "treehill", "garden", "stump", "counter", "kitchen"}


def test_table_1_has_every_scheme_attack_scene_and_target_once_and_a_score_per_row():
    rows = {(r.scheme, r.variant, r.target): {*r.values} for r in PRINTED if r.table == 1 and r.metric == "psnr"}
    assert rows == dict.fromkeys(product(SCHEMES, VARIANTS, TARGETS), NINE)
    scores = [(r.scheme, r.variant) for r in PRINTED if r.metric == "score"]
    assert sorted(scores) == sorted(product(SCHEMES, VARIANTS))
    assert sum(r.table == 1 for r in PRINTED) == 18 * 3


def test_the_recomputed_score_is_the_mean_over_scenes_of_message_drop_minus_scene_drop():
    drops = {}
    for target in TARGETS:
        before = psnr_by_scene(PRINTED, "splats_in_splats", "unattacked", target)
        after = psnr_by_scene(PRINTED, "splats_in_splats", "gspure", target)
        drops[target] = {scene: before[scene] - after[scene] for scene in NINE}
    by_hand = np.mean([drops["message"][scene] - drops["scene"][scene] for scene in NINE])
    assert score(mean_psnr(PRINTED), "splats_in_splats", "gspure") == pytest.approx(by_hand)
    claims = [check for check in CHECKS if (check.claim.place, check.claim.scheme) == ("Table 1", "splats_in_splats")]
    (check,) = (check for check in claims if check.claim.variant == "gspure")
    assert (check.claim.value, round(check.recomputed, 2)) == (15.21, 14.87)
    interval = score_interval(PRINTED, "splats_in_splats", "gspure")
    assert (interval.mean, interval.scenes) == (pytest.approx(by_hand), 9)


def test_our_results_stand_beside_table_1_by_condition(tmp_path, capsys):
    outcomes = benchmark({"a": {"gspure": (0.0, 9.0)}}, scheme="planted")
    for protocol, drop in (("own", 12.0), ("shared", 3.0)):
        drops = {scene: {"gspure": (1.0, drop)} for scene in "ab"}
        outcomes += benchmark(drops, scheme="gs_hider", protocol=protocol)
    ours = survival(outcomes)
    write_table(tmp_path / "survival.csv", Survival, ours)
    assert main(["paper-check", "--survival", str(tmp_path / "survival.csv")]) == 0
    rows = {(r.condition.scheme, r.condition.protocol, r.variant): r for r in beside(PRINTED, ours)}
    assert len(rows) == 4 * len(ATTACKS)
    measured = [(r.scenes, r.scene_drop, r.message_drop, r.score) for r in rows.values() if r.scenes]
    assert measured == [(2, 1.0, 12.0, 11.0), (2, 1.0, 3.0, 2.0)]
    assert rows["gs_hider", "own", "gspure"].paper_rms_ratio == pytest.approx(18.18, abs=0.005)
    assert "| GSPure " in capsys.readouterr().out


def test_the_command_prints_every_number_and_writes_a_row_for_each(tmp_path, capsys):
    assert main(["paper-check", "--out", str(tmp_path / "paper.csv")]) == 0
    printed = capsys.readouterr().out
    assert re.search(r"15\.21 \| +14\.87 \[", printed)
    rows = list(csv.DictReader((tmp_path / "paper.csv").read_text().splitlines()))
    assert len(rows) == len(CHECKS)
    failed = [row for row in rows if row["holds"] == "False"]
    assert f"{len(failed)} of {len(rows)} numbers do not follow" in printed
