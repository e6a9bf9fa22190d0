"""Where a message's own weight lies: on what everybody sees, or on what hardly anybody would miss.

The share of it on units of low public weight foretells how much of a message pruning by weight can take.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.opencl.device import Device
from gspure.opencl.frame import Energy
from gspure.progress import track
from gspure.pruning import plain_prune_mask
from gspure.renderer import Renderer
from gspure.schemes.asset import Asset, of_units
from gspure.schemes.scheme import Key
from gspure.weights import Reduction, accumulate


def hidden_weights(
    asset: Asset,
    key: Key,
    extraction: str,
    cameras: Sequence[Camera],
    energy: Energy,
    device: Device | None = None,
    reduction: Reduction = "sum",
) -> NDArray[np.float32]:
    """Return the mean contribution [K] of each unit to views of the message, as omega_k is to those of the scene."""

    def stage(camera: Camera) -> NDArray[Any]:
        gaussians, units = key.gaussians(asset, camera, extraction)
        return of_units(Renderer(gaussians, device, energy=energy).contributions(camera), units)

    return accumulate(map(stage, track(cameras, "hidden weight")), len(asset.units), reduction)


def share_on_low(weights: NDArray[Any], hidden: NDArray[Any], tau: float) -> float:
    """Return the share of `hidden` weight [K] on units whose public one is below the mean / `tau`; 0 if none is."""
    total = float(np.sum(hidden, dtype=np.float64))
    return float(np.sum(hidden[plain_prune_mask(weights, tau)], dtype=np.float64)) / total if total else 0.0
