"""The paper's printed numbers (Huang et al. 2026) as data: references beside our own results, and input of a check.

``cells.csv`` holds every cell of Tables 1 to 3 with its printed row and column, ``claims.csv`` the numbers of the text
that follow from them. Fig. 5 prints curves without numbers. The numbers are references, never targets.
"""

from gspure.evaluation.paper.beside import Beside, beside
from gspure.evaluation.paper.cells import Cell, read_cells
from gspure.evaluation.paper.checks import Check, Claim, check_claims
from gspure.evaluation.paper.inconsistencies import find_inconsistencies
from gspure.evaluation.paper.quantities import rms_ratio_of, score_interval

__all__ = [
    "Beside",
    "Cell",
    "Check",
    "Claim",
    "beside",
    "check_claims",
    "find_inconsistencies",
    "read_cells",
    "rms_ratio_of",
    "score_interval",
]
