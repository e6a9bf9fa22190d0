"""The cells of the paper's tables, with where they are printed."""

from __future__ import annotations

import csv
from importlib.resources import files
from typing import Final, NamedTuple

from gspure.evaluation.outcomes import MESSAGE, SCENE

SCHEMES: Final = ("splats_in_splats", "gs_hider", "secure_gs")
ATTACKS: Final = ("random_pruning", "feature_scaling", "gaussian_noise", "gof", "gspure")
TARGETS: Final = (SCENE, MESSAGE)

PSNR, SSIM, SCORE = "psnr", "ssim", "score"

MEAN: Final = "mean"
"""In the place of a scene: the mean over all nine."""


class Cell(NamedTuple):
    """One printed number."""

    table: int
    row: str
    column: str
    """The labels of its row and column in the paper."""

    scheme: str
    variant: str
    """An attack, ``watermarked``, or a configuration of the ablation such as ``opacity_weight``."""

    scene: str
    target: str
    """``scene``, ``message``, or nothing for a Score."""

    metric: str
    value: float
    """dB, or an SSIM."""

    bold: bool


def read_cells() -> list[Cell]:
    """Return all cells of Tables 1 to 3, row by row."""
    return [_cell(row) for row in read_rows("cells.csv")]


def read_rows(name: str) -> list[dict[str, str]]:
    """Return the rows of a table of this package."""
    text = files("gspure.evaluation.paper").joinpath(name).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines(), strict=True))


def _cell(printed: dict[str, str]) -> Cell:
    table, row, column, scheme, variant, scene, target, metric, value, bold = printed.values()
    return Cell(int(table), row, column, scheme, variant, scene, target, metric, float(value), bold == "bold")
