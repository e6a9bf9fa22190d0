"""The paper's printed numbers: consistent with what the text says of them, and recomputed correctly.

They are references. Nothing here compares our own results with them.
"""

import csv
import re

import numpy as np
import pytest

from experiments import paper_check
from experiments.paper_check import beside_table
from experiments.printed import (
    ATTACKS,
    TARGETS,
    Check,
    Claim,
    beside,
    check_claims,
    mean_psnr,
    psnr_by_scene,
    read_rows,
    score,
    score_interval,
)
from gspure.evaluation.judging import judged
from gspure.evaluation.outcomes import with_references
from tests.outcome_cases import attacked

PRINTED = read_rows()
CHECKS = check_claims(PRINTED)
NINE = {"bicycle", "bonsai", "room", "flowers", "treehill", "garden", "stump", "counter", "kitchen"}


def test_the_recomputed_score_is_the_mean_over_scenes_of_message_drop_minus_scene_drop():
    drops = {}
    for target in TARGETS:
        before = psnr_by_scene(PRINTED, "splats_in_splats", "unattacked", target)
        after = psnr_by_scene(PRINTED, "splats_in_splats", "gspure", target)
        drops[target] = {scene: before[scene] - after[scene] for scene in NINE}
    by_hand = np.mean([drops["message"][scene] - drops["scene"][scene] for scene in NINE])
    assert score(mean_psnr(PRINTED), "splats_in_splats", "gspure") == pytest.approx(by_hand)
    interval = score_interval(PRINTED, "splats_in_splats", "gspure")
    assert (interval.mean, interval.scenes) == (pytest.approx(by_hand), 9)


def test_the_papers_numbers_that_do_not_follow_from_its_tables() -> None:
    failed: dict[str, list[float]] = {}
    for check in CHECKS:
        if not check.holds:
            failed.setdefault(check.claim.place, []).append(check.claim.value)
    assert failed == {
        "Table 1": [15.21, 5.03],
        "Table 3": [25.62, 10.19],
        "Abstract": [16.34, 1.0],
        "Original Scene Fidelity": [9.68, 2.21],
        "Watermark Purification Effectiveness": [5.44, 12.97, 4.39],
    }


def test_a_claim_of_less_than_a_bound_does_not_hold_at_the_bound() -> None:
    claim = Claim("Table 1", "words", "score", "gs_hider", "gspure", "", "<", 1.0)
    assert [Check(claim, recomputed).holds for recomputed in (0.5, 1.0)] == [True, False]


def test_our_results_stand_beside_table_1_by_condition():
    drops = {("planted", ""): 9.0, ("gs_hider", "own"): 12.0, ("gs_hider", "shared"): 3.0}
    outcomes = []
    for (scheme, protocol), drop in drops.items():
        for scene, seed, more in (("a", 0, -0.5), ("a", 1, 0.5), ("b", 0, 0.0)):
            for variant, (of_scene, of_message) in {"unattacked": (0, 0), "gspure": (1.0, drop + more)}.items():
                where = {"scheme": scheme, "protocol": protocol}
                outcomes.append(attacked(variant, of_scene, of_message, scene, seed, **where))
    ours = judged(with_references(outcomes), {})
    rows = {(r.condition.scheme, r.condition.protocol, r.variant): r for r in beside(PRINTED, ours)}
    assert len(rows) == 4 * len(ATTACKS)
    measured = [(r.scenes, r.scene_drop, r.message_drop, r.score) for r in rows.values() if r.scenes]
    assert measured == [(2, 1.0, 12.0, 11.0), (2, 1.0, 3.0, 2.0)]
    assert "| GSPure " in beside_table([*rows.values()]).markdown()


def test_the_check_prints_every_number_and_its_table_is_the_committed_one(tmp_path, capsys, monkeypatch):
    recorded = paper_check.TABLE.read_text()
    monkeypatch.setattr(paper_check, "TABLE", tmp_path / "paper_check.csv")
    paper_check.main([])
    assert paper_check.TABLE.read_text() == recorded
    printed = capsys.readouterr().out
    assert re.search(r"15\.21 \| +14\.87 \[", printed)
    rows = list(csv.DictReader(recorded.splitlines()))
    assert len(rows) == len(CHECKS)
    failed = [row for row in rows if row["holds"] == "False"]
    assert f"{len(failed)} of {len(rows)} numbers do not follow" in printed
