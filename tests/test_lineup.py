"""What every attack leaves, side by side: which variants, which view, and what a tile says."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from PIL import Image

from gspure.cli import main
from gspure.evaluation.outcomes import Outcome
from gspure.evaluation.results import write_results
from gspure.figures import lineup, style
from gspure.figures.lineup import COLUMNS, Column, chosen, typical, write_lineup
from gspure.images import write_image
from tests.contest_cases import measured

PHOTOGRAPH = np.full((6, 8, 3), 0.5, np.float32)


def outcome(variant, scene=30.0, message=30.0, **known):
    reference, targets = (
        {name: measured(name, psnr) for name, psnr in (("scene", a), ("message", b))}
        for a, b in ((30.0, 30.0), (scene, message))
    )
    return Outcome("planted", "room", variant, targets, dict.fromkeys(targets, 3), reference=reference, **known)


def names(outcomes):
    return [o.variant for o in outcomes]


def test_of_an_attack_at_several_strengths_the_highest_score_is_shown():
    outcomes = [outcome("unattacked"), outcome("weak", 29, 28), outcome("fit", 28, 10), outcome("strong", 5, 5)]
    sweeps = {"pruning": ["weak", "fit", "strong", "elsewhere"], "other": ["nowhere"]}
    assert names(chosen(outcomes, sweeps)) == ["unattacked", "fit"]
    assert names(chosen(outcomes, {})) == names(outcomes)


def test_the_lineup_shows_gspure_itself_and_the_first_failed_strength():
    failed = [Outcome("planted", "room", name, {}, {}, failure="no memory") for name in ("a", "b")]
    outcomes = [outcome("tau_n_1", 30, 5), outcome("gspure", 20, 20), *failed, outcome("clean")]
    shown = chosen(outcomes, {"gspure": ["tau_n_1", "gspure"], "other": ["a", "b"]})
    assert names(shown) == ["gspure", "a"], "controls are no attacks"


def test_the_lineup_shows_the_view_of_median_psnr():
    shown = {name: PHOTOGRAPH + error for name, error in (("a", 0.3), ("b", 0.1), ("c", 0.2), ("d", 0.4))}
    truth = dict.fromkeys(shown, PHOTOGRAPH)
    assert typical(truth, shown) == "a"
    assert typical(truth, {name: shown[name] for name in "abc"}) == "c"


@pytest.fixture
def drawn(monkeypatch):
    """The labels and texts of the tiles, as they are drawn."""
    said: list[str] = []
    monkeypatch.setattr(lineup, "show", lambda axes, image, label: said.append(label))
    monkeypatch.setattr(Axes, "text", lambda axes, x, y, text, **style: said.append(text))
    return said


def test_a_tile_shows_psnr_dagger_and_reason_of_failure(tmp_path, drawn):
    columns = [
        Column("truth", {"message": PHOTOGRAPH}),
        Column("noise", {"message": PHOTOGRAPH + np.float32(0.1)}, frozenset({"message"})),
        Column("gof", {}, failure="no memory"),
    ]
    write_lineup(tmp_path / "lineup.png", ["message"], columns)
    assert drawn == ["", "20.00 dB †", "failed", "no memory"]


def test_many_columns_are_split_into_blocks_of_equal_tiles(tmp_path):
    sizes = []
    for count in (COLUMNS, 4 * COLUMNS - 1):
        columns = [Column(f"v{i}", {"scene": PHOTOGRAPH, "message": PHOTOGRAPH}) for i in range(count)]
        write_lineup(tmp_path / "lineup.png", ["scene", "message"], columns)
        with Image.open(tmp_path / "lineup.png") as image:
            sizes.append(image.size)
    assert {width for width, _ in sizes} == {style.PAGE * style.DPI}
    assert sizes[1][1] == pytest.approx(4 * sizes[0][1], rel=0.1)


@pytest.fixture
def results(tmp_path):
    outcomes = [outcome("unattacked"), outcome("noise", reached={"message": False})]
    outcomes += [Outcome("planted", "room", "gof", {}, {}, failure="no memory")]
    write_results(tmp_path / "results.csv", outcomes)
    for target in ("scene", "message"):
        for i, view in enumerate("abc"):
            write_image(tmp_path / "truth" / target / f"{view}.png", PHOTOGRAPH)
            for variant in ("unattacked", "noise"):
                write_image(tmp_path / variant / target / f"{view}.png", PHOTOGRAPH + np.float32(0.1 * (i + 1)))
    return tmp_path


def command(folder, *titles):
    columns = [f"--column={title}={folder / title}" for title in titles]
    table = ["--table", str(folder / "results.csv"), "--name", "planted/room"]
    return ["figures", "attacks", *table, *columns, "--out", str(folder / "attacks.png")]


def test_the_command_shows_what_is_in_the_table(results: Path) -> None:
    assert main(command(results, "truth", "unattacked", "noise", "gof")) == 0
    note = json.loads((results / "attacks.png.json").read_text())
    shown = {f"{name} {target}" for name in ("truth", "unattacked", "noise") for target in ("scene", "message")}
    assert note["inputs"].keys() == {"table", *shown}
    assert note["settings"]["caption"].startswith("View b ")
    assert "†" in note["settings"]["caption"]
    assert main(command(results, "unattacked", "noise")) == 0, "without a truth"


def test_a_failed_attack_chooses_no_view(results: Path) -> None:
    for titles in (["gof", "noise"], ["gof"], []):
        assert main(command(results, "unattacked", *titles)) == 0


def test_a_message_with_views_of_its_own_is_shown_in_a_view_of_its_own(results: Path) -> None:
    for variant in ("truth", "unattacked", "noise"):
        for view in "abc":
            (results / variant / "scene" / f"{view}.png").rename(results / variant / "scene" / f"desk_{view}.png")
    assert main(command(results, "truth", "unattacked", "noise")) == 0
    inputs = json.loads((results / "attacks.png.json").read_text())["inputs"]
    assert (inputs["noise scene"]["file"], inputs["noise message"]["file"]) == ("desk_b.png", "b.png")


def test_without_the_unattacked_model_there_is_nothing_to_compare(results: Path, capsys) -> None:
    assert main(command(results, "truth", "noise")) == 2
    assert "expected unattacked of planted/room" in capsys.readouterr().err


def test_unknown_and_repeated_columns_and_sweeps_are_refused(results: Path, capsys) -> None:
    for words, reason in (
        ([*command(results, "truth", "unattacked", "nose")], "expected a variant of planted/room, found nose"),
        ([*command(results, "truth", "unattacked"), "--sweep", "noise=nose"], "expected an attack of the table"),
    ):
        assert main(words) == 2
        (error,) = capsys.readouterr().err.splitlines()
        assert reason in error
        assert error.endswith("(did you mean noise?)")
    with pytest.raises(SystemExit, match="2"):
        main(command(results, "truth", "unattacked", "noise", "noise"))
    assert "found noise again" in capsys.readouterr().err
    assert not (results / "attacks.png").exists()
