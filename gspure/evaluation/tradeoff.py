r"""Attacks compared at equal damage to the scene.

The Score subtracts the drop of the scene from that of the message, so an attack that destroys both can score well. The
drop of the message at a *fixed* drop of the scene, read from a sweep over the attack's strength, avoids this.
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gspure.files import Bools

MATCHED_DAMAGES: Final = (0.3, 0.7, 1.5, 2.0)  # dB, from barely visible to the customary 2 dB; ours
DAMAGE_TOLERANCE: Final = 0.04  # dB; ours: the size of the smallest differences shown


def pareto_front(scene_drops: ArrayLike, message_residuals: ArrayLike) -> Bools:
    """Return which points no other one dominates, that is, equals or undercuts in both and undercuts in one: bool [n].

    An attacker minimizes both the damage to the scene and what remains of the message, such as its PSNR. Coincident
    points are on the front together.
    """
    points = np.column_stack([scene_drops, message_residuals])
    no_worse = (points[:, None] <= points).all(axis=2)
    better = (points[:, None] < points).any(axis=2)
    return np.asarray(~(no_worse & better).any(axis=0))


def matched_message_drop(scene_drops: ArrayLike, message_drops: ArrayLike, at: float) -> float | None:
    """Return the drop of the message at a fixed drop of the scene, `at`, dB; None outside the scene drops of the sweep.

    Drops [n] are those of one point per strength. The result is linear between neighbouring points of the sweep's
    Pareto front. A setting that damages the scene more and removes less than another one is skipped, since an attacker
    would not choose it.
    """
    points = np.column_stack([scene_drops, message_drops])
    if not points[:, 0].min() <= at <= points[:, 0].max():
        return None
    front = np.unique(points[pareto_front(points[:, 0], -points[:, 1])], axis=0)
    return float(np.interp(at, front[:, 0], front[:, 1]))
