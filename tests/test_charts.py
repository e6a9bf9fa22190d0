"""Charts and grids of images, as matplotlib holds them."""

from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gspure.evaluation.outcomes import Outcome
from gspure.figures import charts, panels, style
from gspure.figures.clouds import Purified
from gspure.figures.panels import chosen, draw_attacks, draw_before_after
from gspure.images import write_image
from gspure.public_model import PublicModel
from tests.contest_cases import measured
from tests.models import gaussians

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
def test_the_histogram_shows_the_thresholds(tmp_path: Path, drawn, tau_c, tau_n, lines) -> None:
    weights = np.concatenate([np.zeros(30), np.geomspace(1e-6, 1e3, 70)]).astype(np.float32)
    public = PublicModel(gaussians(means=np.zeros((100, 3)), scales=0.1))
    shown = Purified(public, np.full(100, -1, np.int32), weights, None, tau_c, tau_n)
    charts.write_weight_histogram(tmp_path / "weights.png", shown)
    marked = [10 ** line.get_xdata()[0] for line in drawn[0].axes[0].lines]
    assert marked == pytest.approx([weights.mean(dtype=np.float64) / tau for tau in lines])


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


def test_a_difference_is_drawn_beside_the_views_before_and_after(tmp_path: Path, drawn) -> None:
    for folder, names, value in (("truth", "abcd", 0.0), ("gspure", "bcde", 0.1)):
        for name in names:
            write_image(tmp_path / folder / f"{name}.png", np.full((8, 10, 3), value, np.float32))
    caption = draw_before_after(tmp_path / "panels.png", {name: tmp_path / name for name in ("truth", "gspure")}, 2)
    assert caption.startswith("2 of 3 views, with their PSNR against truth")
    axes = drawn[0].subfigs[0].axes
    assert [ax.get_title() for ax in axes] == ["truth", "GSPure", "|difference| × 5", "", "", ""]
    assert [ax.get_xlabel() for ax in axes] == ["b", "19.83 dB", "", "d", "19.83 dB", ""]
    assert np.unique(axes[2].images[0].get_array()).tolist() == [130]


@pytest.mark.parametrize(
    ("variants", "sweeps", "shown"),
    [
        (["unattacked", ("weak", 28), ("fit", 10), "clean"], {"s": ["weak", "fit", "absent"]}, ["unattacked", "fit"]),
        ([("weak", 28), ("fit", 10)], {}, ["weak", "fit"]),
        ([("tau_n_1", 5), ("gspure", 20)], {"gspure": ["tau_n_1", "gspure"]}, ["gspure"]),
        (["a", "b"], {"failed": ["a", "b"]}, ["a"]),
    ],
    ids=["highest Score", "no sweep", "GSPure itself", "first of equals"],
)
def test_of_an_attack_at_several_strengths_one_is_shown(variants, sweeps, shown) -> None:
    outcomes = [outcome(v, 30, 30) if isinstance(v, str) else outcome(v[0], 30, v[1]) for v in variants]
    assert [o.variant for o in chosen(outcomes, sweeps)] == shown


def test_the_view_of_median_psnr_is_shown_after_every_attack(tmp_path: Path, monkeypatch) -> None:
    for target in ("scene", "message"):
        for i, view in enumerate("abc"):
            image = np.full((6, 8, 3), 0.5, np.float32)
            write_image(tmp_path / "truth" / target / f"{view}.png", image)
            for variant in ("unattacked", "noise"):
                write_image(tmp_path / variant / "renders" / target / f"{view}.png", image + np.float32(0.1 * (i + 1)))
    noise = replace(outcome("noise", 30, 30), reached={"message": False})
    gof = Outcome("planted", "room", "gof", failure="no memory")
    drawn = []
    monkeypatch.setattr(panels, "write_tiles", lambda *facts: drawn.append(facts))
    outcomes = [outcome("unattacked", 30, 30), noise, gof, outcome("clean", 30, 30)]
    caption, views = draw_attacks(tmp_path / "a.png", tmp_path, outcomes, {}, tmp_path / "truth")
    assert views == {"scene": "b", "message": "b"}
    assert caption.startswith("View b of 3 after every attack: the one with the median message PSNR before attacks.")
    assert "†" in caption
    ((_, titles, rows, names),) = drawn
    assert (titles, names) == (["truth", "unattacked", "noise", "GOF"], ["scene", "message"])
    assert [[(tile.label, tile.text) for tile in row] for row in rows] == [
        [("", ""), ("13.98 dB", ""), (f"13.98 dB{dagger}", ""), ("failed", "no memory")] for dagger in ("", " †")
    ]
