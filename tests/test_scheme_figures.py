"""Figures over all scenes of a condition: the sweep of pruning factors, and the Pareto front."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Text

from gspure.cli import main
from gspure.evaluation.detection import Detection
from gspure.evaluation.intervals import Interval
from gspure.evaluation.results import write_results
from gspure.evaluation.survival import survival
from gspure.figures.factors import Point, curve, write_factor_curves
from gspure.figures.plots import write_outcomes
from gspure.figures.tradeoff import places, write_tradeoff
from tests.contest_cases import BEFORE, benchmark, outcome
from tests.test_matched import outcomes
from tests.test_plots import drawn  # noqa: F401


def point(tau_n: float, tau_c: float, scene: float, message: float) -> Point:
    psnr = {"scene": scene, "message": message}
    return Point((tau_n, tau_c), {name: Interval(x, x - 1, x + 1, 0.75, 3) for name, x in psnr.items()})


POINTS = [point(4, 3, 29, 12), point(1, 3, 25, 8), point(2, 3, 27, 9), point(4, 1, 26, 11), point(1, 1, 20, 5)]
TWO = outcomes(
    room={"gspure": (1.0, 18.0), "harsh": (3.0, 20.0), "random": (5.0, 2.0), "same": (3.0, 20.0)},
    vault={"gspure": (1.0, 14.0), "harsh": (2.0, 16.0), "random": (4.0, 0.0), "same": (2.0, 16.0)},
)


@pytest.mark.parametrize(("axis", "factors"), [(0, [1, 2, 4]), (1, [1, 3])])
def test_a_curve_has_the_points_where_the_other_factor_is_the_method_s(axis: int, factors: list[int]) -> None:
    assert [p.factors[axis] for p in curve(POINTS, axis, (4, 3))] == factors


def test_curves_show_means_and_bands_by_target_and_factor(tmp_path: Path, drawn) -> None:  # noqa: F811
    write_factor_curves(tmp_path / "sweep.png", POINTS, (4, 3))
    axes = drawn[0].axes
    assert [ax.get_ylabel() for ax in axes] == ["scene PSNR (dB)", "", "message PSNR (dB)", ""]
    assert axes[2].lines[0].get_xydata().tolist() == [[1, 8], [2, 9], [4, 12]]
    assert [ax.lines[1].get_xydata().tolist() for ax in axes[2:]] == [[[4, 12]], [[3, 12]]]  # the method's own
    band = axes[2].collections[0].get_paths()[0].vertices
    assert (band[:, 1].min(), band[:, 1].max()) == (7, 13)


@pytest.mark.parametrize(("bits", "label"), [(32, "mark (mine)\ncorrect bits (%)"), (0, "mark (mine) score")])
def test_readings_of_a_mark_are_no_decibels(tmp_path: Path, drawn, bits: int, label: str) -> None:  # noqa: F811
    read = {"gspure": 53.0, "unattacked": 98.0}
    marked = [
        outcome(name, targets={"scene": 30.0}, detections={"mine": Detection(level, 1.0, 1.0, 1.0, True, 3, bits)})
        for name, level in read.items()
    ]
    write_results(tmp_path / "results.csv", marked)
    words = ["--table", str(tmp_path / "results.csv"), "--condition", "sis", "--out", str(tmp_path / "sweep.png")]
    assert main(["figures", "sweep", *words, "--point", "gspure=4,4", "--point", "unattacked=1,4"]) == 0
    assert [axes.get_ylabel() for axes in drawn[0].axes] == ["scene PSNR (dB)", "", label, ""]
    assert drawn[0].axes[2].lines[0].get_ydata().tolist() == [98.0, 53.0]


def test_a_sweep_of_which_nothing_is_known_is_refused(tmp_path: Path, capsys) -> None:
    write_results(tmp_path / "results.csv", [replace(TWO[0], targets={}, off_path={}, failure="out of memory")])
    words = ["--table", str(tmp_path / "results.csv"), "--condition", "sis", "--out", str(tmp_path / "sweep.png")]
    assert main(["figures", "sweep", *words, "--point", f"{TWO[0].variant}=4,4"]) == 2
    assert "PSNR: expected" in capsys.readouterr().err


def test_variants_lie_at_their_means_and_those_that_do_the_same_lie_together() -> None:
    found = {place.variants: place[:2] for place in places(TWO)}
    assert found == {
        ("unattacked",): (0.0, 28.0),
        ("gspure",): (1.0, 12.0),
        ("harsh", "same"): (2.5, 10.0),
        ("random",): (4.5, 27.0),
    }


def test_a_variant_that_lacks_a_scene_is_left_out() -> None:
    fewer = [o for o in TWO if (o.scene, o.variant) != ("vault", "harsh")]
    assert {name for place in places(fewer) for name in place.variants} == {"unattacked", "gspure", "same", "random"}


def test_every_point_has_its_name(tmp_path: Path, drawn) -> None:  # noqa: F811
    front = write_tradeoff(tmp_path / "tradeoff.png", TWO)
    assert [place.variants[0] for place in front] == ["unattacked", "gspure", "harsh"]
    axes = drawn[0].axes[0]
    assert {text.get_text(): text.xy for text in axes.texts if text.get_text() != "//"} == {
        "unattacked": (0, 28), "GSPure": (1, 12), "harsh = same": (2.5, 10), "random": (4.5, 27)
    }  # fmt: skip
    assert np.asarray(axes.lines[0].get_xydata()).shape == (4, 2)


def test_names_do_not_overlap_each_other_or_leave_the_axes(tmp_path: Path, drawn) -> None:  # noqa: F811
    close = {f"attack_{i}": (1 + i / 1000, 16 + i / 1000) for i in range(30)}
    write_tradeoff(tmp_path / "tradeoff.png", outcomes(room={**close, "far": (4.0, 22.0)}))
    drawn[0].draw_without_rendering()  # the SVG was placed at another resolution
    axes = drawn[0].axes[0]
    boxes = [Text.get_window_extent(text) for text in axes.texts if text.get_text() != "//"]
    assert 4 <= len(boxes) < 32
    assert not any(box.count_overlaps(boxes[:i]) for i, box in enumerate(boxes))
    assert all(axes.bbox.x0 <= box.x0 and box.x1 <= axes.bbox.x1 for box in boxes)


@pytest.fixture
def table(tmp_path: Path) -> Path:
    write_results(tmp_path / "results.csv", TWO)
    return tmp_path / "results.csv"


def test_the_commands_write_a_figure_with_its_caption(table: Path) -> None:
    folder = table.parent / "figures" / "sis"
    common = ["--table", str(table), "--condition", "sis", "--out"]
    points = ["--point", "gspure=4,4", "--point", "harsh=1,4"]
    assert main(["figures", "sweep", *common, str(folder / "sweep.png"), *points]) == 0
    assert main(["figures", "tradeoff", *common, str(folder / "tradeoff.png")]) == 0
    captions = [json.loads(path.read_text())["settings"]["caption"] for path in sorted(folder.glob("*.png.json"))]
    assert "τ_n = 4 or τ_c = 4 (ring: both). Mean over 2 scenes and their range." in captions[0]
    assert "Pareto front: 3." in captions[1]
    assert "floor" not in captions[1]  # there are no controls


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ["sweep", "--condition", "sis", "--point", "gspurr=4,4"],
            "results.csv: variant: expected a variant of sis, found gspurr (did you mean gspure?)",
        ),
        (
            ["sweep", "--condition", "other", "--point", "gspure=4,4"],
            "results.csv: condition: expected other, found sis",
        ),
        (["tradeoff", "--condition", "other"], "results.csv: condition: expected other, found sis"),
    ],
)
def test_missing_rows_of_the_table_are_reported_in_one_line(table: Path, capsys, words: list[str], told: str) -> None:
    assert main(["figures", *words, "--table", str(table), "--out", str(table.parent / "f.png")]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1


def test_the_dashed_line_is_the_floor_that_survival_is_judged_by(tmp_path: Path, drawn) -> None:  # noqa: F811
    outcomes = benchmark({scene: {"gspure": (1.0, 18.0)} for scene in ("room", "vault")})
    write_results(tmp_path / "results.csv", outcomes)
    words = ["--table", str(tmp_path / "results.csv"), "--condition", "sis", "--out", str(tmp_path / "tradeoff.png")]
    assert main(["figures", "tradeoff", *words]) == 0
    (dashed,) = (line for line in drawn[0].axes[0].lines if line.get_linestyle() == "--")
    gspure = next(row for row in survival(outcomes) if row.variant == "gspure")
    assert gspure.above_floor.mean == BEFORE["message"] - 18.0 - dashed.get_ydata()[0]
    note = json.loads((tmp_path / "tradeoff.png.json").read_text())
    assert "floor" in note["settings"]["caption"]


@pytest.mark.parametrize("factors", ["nan,4", "4,inf", "0,4", "4,-1", "4"])
def test_pruning_factors_that_are_not_two_numbers_above_0_are_refused(factors: str, capsys) -> None:
    words = ["--table", "t.csv", "--condition", "planted", "--point", f"gspure={factors}", "--out", "x.png"]
    with pytest.raises(SystemExit, match="2"):
        main(["figures", "sweep", *words])
    assert f"found 'gspure={factors}'" in capsys.readouterr().err


def test_a_variant_with_two_pairs_of_factors_is_refused(table: Path, capsys) -> None:
    words = ["--table", str(table), "--condition", "sis", "--point", "gspure=4,4", "--point", "gspure=1,4"]
    with pytest.raises(SystemExit, match="2"):
        main(["figures", "sweep", *words, "--out", str(table.parent / "sweep.png")])
    assert "found gspure again" in capsys.readouterr().err


def test_captions_name_variants_that_lack_a_scene(table: Path) -> None:
    fewer = [o for o in TWO if (o.scene, o.variant) != ("vault", "harsh")]
    write_results(table, fewer)
    common = ["--table", str(table), "--condition", fewer[0].condition.key, "--out"]
    out = table.parent / "figure.png"
    assert main(["figures", "tradeoff", *common, str(out)]) == 0
    assert (
        "Not shown, since they lack a scene or a random seed: harsh."
        in json.loads(Path(f"{out}.json").read_text())["settings"]["caption"]
    )
    assert main(["figures", "sweep", *common, str(out), "--point", "gspure=4,4", "--point", "harsh=1,4"]) == 0
    assert "Mean over 2 scenes and their range; harsh over 1." in Path(f"{out}.json").read_text()


def test_figures_name_the_damage_that_a_search_reached(tmp_path: Path, drawn) -> None:  # noqa: F811
    missed = outcomes(room={"noise@1dB": (0.17, 2.0), "crop@1dB": (1.03, 3.0)})
    write_tradeoff(tmp_path / "tradeoff.png", missed)
    write_outcomes(tmp_path / "outcomes.png", missed)
    expected = {"noise, 1 dB (0.17 dB reached)", "crop, 1 dB"}
    assert {text.get_text() for text in drawn[0].axes[0].texts} >= expected
    assert {label.get_text() for label in drawn[1].axes[0].get_yticklabels()} >= expected
    marks = {line.get_xdata()[0] for line in drawn[0].axes[0].lines if line.get_linewidth() == 0.4}
    assert marks == {1.0}
