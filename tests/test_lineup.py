"""What every attack leaves, side by side: which variants, which view, and what a tile says."""

from pathlib import Path

import numpy as np
import pytest

from gspure.evaluation.outcomes import Outcome
from gspure.figures import lineup, style
from gspure.figures.lineup import chosen, draw_attacks
from gspure.images import write_image
from tests.contest_cases import measured


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    monkeypatch.setattr(style, "DPI", 50)


PHOTOGRAPH = np.full((6, 8, 3), 0.5, np.float32)


def outcome(variant, scene=30.0, message=30.0, **known):
    reference, targets = (
        {name: measured(name, psnr) for name, psnr in (("scene", a), ("message", b))}
        for a, b in ((30.0, 30.0), (scene, message))
    )
    return Outcome("keyss", "room", variant, targets, dict.fromkeys(targets, 3), reference=reference, **known)


OUTCOMES = [outcome("unattacked"), outcome("noise", reached={"message": False})]
OUTCOMES += [Outcome("keyss", "room", "gof", failure="no memory"), outcome("clean")]


def names(outcomes):
    return [o.variant for o in outcomes]


def test_of_an_attack_at_several_strengths_the_highest_score_is_shown():
    outcomes = [outcome("unattacked"), outcome("weak", 29, 28), outcome("fit", 28, 10), outcome("strong", 5, 5)]
    sweeps = {"pruning": ["weak", "fit", "strong", "elsewhere"], "other": ["nowhere"]}
    assert names(chosen(outcomes, sweeps)) == ["unattacked", "fit"]
    assert names(chosen(outcomes, {})) == names(outcomes)


def test_the_lineup_shows_gspure_itself_and_the_first_failed_strength():
    failed = [Outcome("keyss", "room", name, failure="no memory") for name in ("a", "b")]
    outcomes = [outcome("tau_n_1", 30, 5), outcome("gspure", 20, 20), *failed, outcome("clean")]
    shown = chosen(outcomes, {"gspure": ["tau_n_1", "gspure"], "other": ["a", "b"]})
    assert names(shown) == ["gspure", "a"], "controls are no attacks"


@pytest.fixture
def results(tmp_path):
    """Views a, b, c, of which the renders are off by 0.1, 0.2 and 0.3."""
    for target in ("scene", "message"):
        for i, view in enumerate("abc"):
            write_image(tmp_path / "truth" / target / f"{view}.png", PHOTOGRAPH)
            for variant in ("unattacked", "noise"):
                image = PHOTOGRAPH + np.float32(0.1 * (i + 1))
                write_image(tmp_path / variant / "renders" / target / f"{view}.png", image)
    return tmp_path


def test_the_view_of_median_psnr_is_shown_of_all_variants(results: Path, monkeypatch) -> None:
    drawn, write_tiles = [], lineup.write_tiles
    monkeypatch.setattr(lineup, "write_tiles", lambda *facts: (drawn.append(facts), write_tiles(*facts)))
    caption, views = draw_attacks(results / "a.png", results, OUTCOMES, {}, results / "truth")
    assert views == {"scene": "b", "message": "b"}
    assert caption.startswith("View b of 3 after every attack: the one with the median message PSNR before attacks.")
    assert "†" in caption
    ((_, titles, rows, names),) = drawn
    assert (titles, names) == (["truth", "unattacked", "noise", "GOF"], ["scene", "message"])
    labels = [[(tile.label, tile.text) for tile in row] for row in rows]
    assert labels == [
        [("", ""), ("13.98 dB", ""), (f"13.98 dB{dagger}", ""), ("failed", "no memory")] for dagger in ("", " †")
    ]
