"""The cells of the paper's tables."""

from pathlib import Path
from typing import Final, Literal, NamedTuple

from gspure.evaluation.csv_tables import read_table
from gspure.evaluation.outcomes import MESSAGE, SCENE

SCHEMES: Final = ("splats_in_splats", "gs_hider", "secure_gs")
ATTACKS: Final = ("random_pruning", "feature_scaling", "gaussian_noise", "gof", "gspure")
TARGETS: Final = (SCENE, MESSAGE)

PSNR, SCORE = "psnr", "score"

DATA: Final = Path(__file__).parent


class Cell(NamedTuple):
    """One printed number."""

    table: int
    row: str  # its label in the paper, like that of the column
    column: str
    scheme: str
    variant: str  # an attack, `unattacked`, or a configuration of the ablation such as `opacity_weight`
    scene: str  # a scene, or `mean` over all nine
    target: str  # `scene` or `message`; empty for a Score
    metric: str
    value: float  # dB, or an SSIM
    bold: Literal["bold", ""]


def read_cells() -> list[Cell]:
    """Return all cells of Tables 1 to 3, row by row."""
    return read_table(DATA / "cells.csv", Cell)
