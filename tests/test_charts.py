"""Files of figures, and what grids of images show."""

from pathlib import Path

import numpy as np
import pytest

from gspure.evaluation.outcomes import Outcome
from gspure.figures import style
from gspure.figures.panels import chosen, draw_before_after
from gspure.images import write_image
from tests.contest_cases import measured

PNG = b"\x89PNG\r\n"


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


def test_views_before_and_after_are_chosen_from_those_that_both_have(tmp_path: Path) -> None:
    for folder, names, value in (("truth", "abcd", 0.0), ("gspure", "bcde", 0.1)):
        for name in names:
            write_image(tmp_path / folder / f"{name}.png", np.full((8, 10, 3), value, np.float32))
    caption = draw_before_after(tmp_path / "panels.png", {name: tmp_path / name for name in ("truth", "gspure")}, 2)
    assert caption.startswith("2 of 3 views, with their PSNR against truth")
    assert (tmp_path / "panels.png").read_bytes()[:6] == PNG


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
