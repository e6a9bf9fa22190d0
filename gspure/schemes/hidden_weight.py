"""The weight of rows in views of the message. Pruning removes the part of it that lies on rows of low public weight."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Bools, Float32
from gspure.cameras.camera import Camera
from gspure.constants import Energy
from gspure.method.pruning import plain_prune_mask
from gspure.method.weights import Reduction, accumulate
from gspure.opencl.device import Device
from gspure.progress import track
from gspure.public_model import PublicModel, merge_by_row
from gspure.renderer import Renderer
from gspure.schemes.scheme import Key, Run


def hidden_weights(
    public: PublicModel,
    key: Key,
    extraction: str,
    cameras: Sequence[Camera],
    energy: Energy,
    device: Device | None = None,
    reduction: Reduction = "sum",
) -> Float32:
    """Return the weight [K] of each row over views of the message, as omega_k is over views of the scene."""

    def contributions(camera: Camera) -> NDArray[Any]:
        gaussians, owners = key.gaussians(public, camera, extraction)
        return merge_by_row(Renderer(gaussians, device, energy=energy).contributions(camera), owners)

    return accumulate(map(contributions, track(cameras, "hidden weight")), len(public.model), reduction)


def low_rows(public: PublicModel, cameras: Sequence[Camera], tau: float, device: Device | None) -> Bools:
    """Return the mask [K] of the rows that `plain_weight` removes: those of low public weight in these views."""
    weights = accumulate(map(public.contributions(device), cameras), len(public.model))
    return plain_prune_mask(weights, tau)


class Hardening:
    """The `low_rows`, measured every `every` iterations; in every second iteration, the message trains without them."""

    def __init__(self, run: Run, every: int) -> None:
        self._run = run
        self._every = every
        self._low: Bools | None = None

    def follow(self, iteration: int, public: Callable[[], PublicModel]) -> None:
        """Measure the rows of the current public model, if the iteration is one for it."""
        run = self._run
        if run.hardened and run.message_weight and iteration % self._every == 0:
            self._low = low_rows(public(), run.pair.scene.views, run.hardened, run.device)

    def left_out(self, iteration: int) -> Bools | None:
        """Return the mask [K] of the rows without which the message trains at an iteration, or None."""
        return self._low if iteration % 2 else None


def share_on_low(weights: NDArray[Any], hidden: NDArray[Any], tau: float) -> float:
    """Return the share of `hidden` weight [K] on rows with a public weight below the mean / `tau`."""
    total = float(np.sum(hidden, dtype=np.float64))
    return float(np.sum(hidden[plain_prune_mask(weights, tau)], dtype=np.float64)) / total
