r"""Attacks compared at equal damage.

The Score subtracts what an attack takes from the scene from what it takes from the message, so one that destroys both
can do well. Beside it stands what each attack takes from the message for the *same* damage to the scene, read from a
sweep over its strength.
"""

from __future__ import annotations

from enum import Enum
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gspure.errors import InputError

MATCHED_DAMAGES: Final = (0.3, 0.7, 1.5, 2.0)
"""Scene drops in dB at which attacks are compared. Ours, from hardly visible on; 2 dB is customary."""


class NotReached(Enum):
    """Why a sweep says nothing about a scene drop; nothing is extrapolated."""

    TOO_GENTLE = "not reached: the strongest setting damages the scene less"
    TOO_HARSH = "not reached: the weakest setting damages the scene more"

    def __str__(self) -> str:
        return self.value


def pareto_front(scene_drops: ArrayLike, message_residuals: ArrayLike) -> NDArray[np.bool_]:
    """Return which points no other point beats: less or equal in both, and less in one.

    Parameters
    ----------
    scene_drops : array [n]
        Damage to the scene, dB.
    message_residuals : array [n]
        What is left of the message, such as its PSNR; the attacker wants both small.

    Returns
    -------
    array [n], bool
        Points that coincide are on the front together.

    Raises
    ------
    InputError
        If a value is NaN or the two differ in length.

    """
    points = _points(scene_drops, message_residuals)
    no_worse = (points[:, None] <= points).all(axis=2)
    better = (points[:, None] < points).any(axis=2)
    return np.asarray(~(no_worse & better).any(axis=0))


def matched_message_drop(scene_drops: ArrayLike, message_drops: ArrayLike, at: float) -> float | NotReached:
    """Return what an attack takes from the message when it may damage the scene by `at`.

    Linear between neighbouring points of the sweep's Pareto front. A setting that damages the scene more and takes less
    than another is passed over: the attacker would choose the other.

    Parameters
    ----------
    scene_drops, message_drops : array [n]
        One point per strength, dB, of one model or averaged over models. The unattacked (0, 0) is one of them only if
        the strength can go down to nothing.
    at : float
        Scene drop, dB.

    Returns
    -------
    float or NotReached
        dB; `NotReached` if `at` lies outside the scene drops of the sweep.

    Raises
    ------
    InputError
        If there is no point, a value is NaN, or the two differ in length.

    """
    points = _points(scene_drops, message_drops)
    if at > points[:, 0].max():
        return NotReached.TOO_GENTLE
    if at < points[:, 0].min():
        return NotReached.TOO_HARSH
    front = np.unique(points[pareto_front(points[:, 0], -points[:, 1])], axis=0)
    return float(np.interp(at, front[:, 0], front[:, 1]))


def matched_score(scene_drops: ArrayLike, message_drops: ArrayLike, at: float) -> float | NotReached:
    r"""Return the Score at a fixed scene drop, :math:`\Delta PSNR_{message} - \Delta PSNR_{scene}`.

    Parameters and errors are those of `matched_message_drop`.
    """
    drop = matched_message_drop(scene_drops, message_drops, at)
    return drop if isinstance(drop, NotReached) else drop - at


def _points(x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
    a, b = np.asarray(x, np.float64).ravel(), np.asarray(y, np.float64).ravel()
    if len(a) != len(b) or not a.size or np.isnan([*a, *b]).any():
        found = f"{a.tolist()} and {b.tolist()}"
        raise InputError("statistics", "points", expected="two rows of numbers of one length", found=found)
    return np.column_stack([a, b])
