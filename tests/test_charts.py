"""Charts, panels and lineups, as matplotlib holds them."""

from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Text

from gspure.evaluation.intervals import Interval
from gspure.evaluation.outcomes import Outcome
from gspure.figures import charts, lineup, panels, style, tradeoff
from tests.contest_cases import measured

RNG = np.random.default_rng(3)
BALL = RNG.normal(size=(400, 3)).astype(np.float32)
PNG = b"\x89PNG\r\n"


@pytest.fixture(autouse=True)
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(style, "DPI", 50)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list:
    """The figures that were written, as matplotlib objects."""
    kept, original = [], style.page

    @contextmanager
    def page(*args, **kwargs):
        with original(*args, **kwargs) as figure:
            kept.append(figure)
            yield figure

    monkeypatch.setattr(style, "page", page)
    return kept


@pytest.mark.parametrize(("tau_c", "tau_n", "lines"), [(4.0, 4.0, [1, 4]), (4.0, 2.0, [1, 4, 2])])
def test_the_histogram_shows_every_gaussian_and_the_thresholds(tmp_path: Path, drawn, tau_c, tau_n, lines) -> None:
    weights = np.concatenate([np.zeros(30), np.geomspace(1e-6, 1e3, 70)]).astype(np.float32)
    pruned = weights < 0.1
    charts.write_weight_histogram(tmp_path / "weights.png", weights, pruned, tau_c, tau_n)
    axes = drawn[0].axes[0]
    steps = [patch for patch in axes.patches if hasattr(patch, "get_data")]
    spread = [np.sum(data.values - data.baseline) for data in (patch.get_data() for patch in steps)]
    at_zero = [bar.get_height() for container in axes.containers for bar in container]
    assert np.add(spread, at_zero) == pytest.approx([100 * np.mean(~pruned), 100 * np.mean(pruned)])
    assert at_zero == pytest.approx([0, 30])
    marked = [10 ** line.get_xdata()[0] for line in axes.lines]
    assert marked == pytest.approx([weights.mean(dtype=np.float64) / tau for tau in lines])
    assert "0" in [label.get_text() for label in axes.get_xticklabels()]


@pytest.mark.parametrize("vector", [False, True])
def test_a_figure_has_the_same_bytes_again_and_a_chart_is_also_a_vector_graphic(tmp_path: Path, vector: bool) -> None:
    for folder in ("first", "second"):
        with style.page(tmp_path / folder / "a.png", 1, 1, vector=vector) as figure:
            figure.text(0, 0, "A")
    files = sorted((tmp_path / "first").iterdir())
    assert [path.name for path in files] == ["a.png", *["a.svg"] * vector]
    assert all(path.read_bytes() == (tmp_path / "second" / path.name).read_bytes() for path in files)
    assert [path.read_bytes()[:5] for path in files] == [PNG[:5], *[b"<?xml"] * vector]


def outcome(variant: str, scene: float, message: float | None = None, scheme: str = "planted") -> Outcome:
    targets, reference = {"scene": measured("scene", scene)}, {}
    if message is not None:
        targets["message"] = measured("message", message, 0.8)
        reference = {name: measured(name, 30.0, 1.0) for name in targets}
    return Outcome(scheme, "room", variant, targets, dict.fromkeys(targets, 3), reference=reference)


def texts(figure) -> list[str]:
    return [text.get_text() for text in figure.axes[0].texts]


def test_outcomes_show_both_targets_and_the_score(tmp_path: Path, drawn) -> None:
    charts.draw_outcomes(tmp_path / "outcomes.png", [outcome("unattacked", 30, 30), outcome("gspure", 29, 12.5)])
    bars = [[bar.get_width() for bar in container] for container in drawn[0].axes[0].containers]
    assert bars == [[30, 29], [30, 12.5]]
    assert {"+0.00", "+16.50", "Score"} <= set(texts(drawn[0]))
    assert [label.get_text() for label in drawn[0].axes[0].get_yticklabels()] == ["unattacked", "GSPure"]


def test_outcomes_without_a_key_show_the_scene_alone(tmp_path: Path, drawn) -> None:
    charts.draw_outcomes(tmp_path / "outcomes.png", [outcome("unattacked", np.inf), outcome("gspure", 29)])
    assert len(drawn[0].axes[0].containers) == 1
    assert "identical" in texts(drawn[0])
    assert "Score" not in texts(drawn[0])


def test_outcomes_without_a_key_show_the_rows_that_attacks_removed(tmp_path: Path, drawn) -> None:
    pruned = replace(outcome("gspure", 29), pruned_share=0.507)
    charts.draw_outcomes(tmp_path / "outcomes.png", [outcome("unattacked", np.inf), pruned])
    assert {"rows removed", "50.7%"} <= set(texts(drawn[0]))


def test_panels_name_the_views_and_the_psnr_against_the_first_column(tmp_path: Path, drawn) -> None:
    black = {name: np.zeros((8, 10, 3), np.float32) for name in ("a", "b")}
    grey = {name: image + np.float32(0.1) for name, image in black.items()}
    panels.write_panels(tmp_path / "panels.png", {"truth": black, "gspure": grey}, ["a", "b"], difference=True)
    axes = drawn[0].axes
    assert [ax.get_title() for ax in axes] == ["truth", "GSPure", "|difference| × 5", "", "", ""]
    assert [ax.get_xlabel() for ax in axes] == ["a", "20.00 dB", "", "b", "20.00 dB", ""]
    assert np.ptp(axes[2].images[0].get_array() - 0.5) < 1e-6


NAME = "price_$5_and_$6 [bold]x[/bold] \\frac{ <b>"
"""Would be a formula to matplotlib, markup to a terminal and to a browser."""


def test_names_from_files_are_no_formulas(tmp_path: Path, drawn) -> None:
    images = {name: {NAME: np.zeros((8, 10, 3), np.float32)} for name in ("truth", NAME)}
    panels.write_panels(tmp_path / "panels.png", images, [NAME], difference=False)
    assert drawn[0].axes[0].get_xlabel() == NAME
    charts.draw_outcomes(tmp_path / "outcomes.png", [outcome("unattacked", 30, 30), outcome(NAME, 29, 12.5)])
    lineup.write_lineup(
        tmp_path / "lineup.png",
        ["scene"],
        [lineup.Column("truth", {"scene": images["truth"][NAME]}), lineup.Column(NAME, {}, failure=NAME)],
    )
    tradeoff.draw_tradeoff(tmp_path / "tradeoff.png", [outcome("unattacked", 30, 30), outcome(NAME, 29, 12.5)])
    assert not any(
        text.get_parse_math() for figure in drawn for text in figure.findobj(Text) if "$5" in text.get_text()
    )
    assert len(drawn) == 4


def test_formulas_in_labels_are_parsed(tmp_path: Path, drawn) -> None:
    charts.write_weight_histogram(
        tmp_path / "w.png", np.geomspace(1e-6, 1, 9).astype(np.float32), np.zeros(9, bool), 4, 2
    )
    psnr = {"scene": Interval(30, 29, 31, 0.5, 3), "message": Interval(20, 19, 21, 0.5, 3)}
    points = [charts.Point((4.0, 4.0), psnr), charts.Point((2.0, 4.0), psnr), charts.Point((4.0, 2.0), psnr)]
    charts.write_factor_curves(tmp_path / "f.png", points, (4.0, 4.0))
    formulas = [text for figure in drawn for text in figure.findobj(Text) if "$" in text.get_text()]
    assert len({text.get_text() for text in formulas}) >= 7
    assert all(text.get_parse_math() for text in formulas)


@pytest.mark.parametrize(
    "weights",
    [
        [np.nan, np.inf, -np.inf, 1, 2],
        [-1.8e33, 1, 2, 0],
        [3.4e38, 1e-45, 0],
        [],
    ],
)
def test_a_histogram_is_drawn_despite_invalid_weights(tmp_path: Path, drawn, weights: list[float]) -> None:
    values = np.array(weights, np.float32)
    charts.write_weight_histogram(tmp_path / "weights.png", values, np.zeros(len(values), bool), 4, 2)
    assert (tmp_path / "weights.png").read_bytes().startswith(PNG)
    damaged = np.count_nonzero(~(np.isfinite(values) & (values >= 0)))
    assert (f"({damaged} negative or not finite" in drawn[0].axes[0].get_xlabel()) == bool(damaged)


@pytest.mark.parametrize("value", [np.inf, np.nan, -1e300])
def test_charts_survive_extreme_outcomes(tmp_path: Path, value: float) -> None:
    ordinary = [outcome("unattacked", 30, 30), outcome("gspure", 29, 12.5)]
    for extreme in (outcome("other", value, 30), outcome("other", 29, value)):
        charts.draw_outcomes(tmp_path / "outcomes.png", [*ordinary, extreme])
        tradeoff.draw_tradeoff(tmp_path / "tradeoff.png", [*ordinary, extreme])
    psnr = {"scene": Interval(value, value, value, 0.0, 1), "message": Interval(20, -np.inf, np.inf, 0.0, 1)}
    charts.write_factor_curves(tmp_path / "f.png", [charts.Point((4.0, 4.0), psnr)], (4.0, 4.0))
    assert {path.name.partition(".")[0] for path in tmp_path.iterdir()} == {"outcomes", "tradeoff", "f"}


@pytest.mark.parametrize("damage", [0.5, 9.0])
def test_the_trade_off_marks_where_its_axis_becomes_logarithmic(tmp_path: Path, drawn, damage: float) -> None:
    tradeoff.draw_tradeoff(tmp_path / "t.png", [outcome("unattacked", 30, 30), outcome("gspure", 30 - damage, 12)])
    (axes,) = drawn[0].axes
    breaks = [text.xy[0] for text in axes.texts if text.get_text() == "//"]
    assert breaks == ([tradeoff.LINEAR] if damage > tradeoff.LINEAR else [])
    assert ("logarithmic" in axes.get_xlabel()) == (damage > tradeoff.LINEAR)
