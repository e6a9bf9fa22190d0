"""Statistics: intervals over scenes and seeds, paired tests, detectability, comparison at equal damage.

The scene is the unit everywhere. Views of a scene and seeds of one embedding share the scene and are not independent,
so they are averaged within scenes, resampled within scenes, and change their signs together.
"""

from gspure.evaluation.statistics.cells import Cells, by_scene, differences
from gspure.evaluation.statistics.detectability import Detectability, detectability
from gspure.evaluation.statistics.intervals import LEVEL, Interval, known_interval, mean_interval
from gspure.evaluation.statistics.significance import PairedTest, holm, paired_test
from gspure.evaluation.statistics.tradeoff import (
    DAMAGE_TOLERANCE,
    MATCHED_DAMAGES,
    matched_message_drop,
    pareto_front,
)

__all__ = [
    "DAMAGE_TOLERANCE",
    "LEVEL",
    "MATCHED_DAMAGES",
    "Cells",
    "Detectability",
    "Interval",
    "PairedTest",
    "by_scene",
    "detectability",
    "differences",
    "holm",
    "known_interval",
    "matched_message_drop",
    "mean_interval",
    "paired_test",
    "pareto_front",
]
