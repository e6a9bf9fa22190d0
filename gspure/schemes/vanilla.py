"""Ordinary training of one of a pair's scenes: clean models, and the base of simple schemes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gspure.model import Gaussians
from gspure.opencl.device import Device
from gspure.opencl.trainable import Parameters, TrainableModel
from gspure.schemes.pair import Pair
from gspure.training.monitor import watched
from gspure.training.output import as_gaussians
from gspure.training.schedule import Schedule
from gspure.training.trainer import Trainer, beginning

Float32 = NDArray[np.float32]


def train(
    pair: Pair,
    images: Sequence[Float32],
    begin: Parameters,
    *,
    iterations: int,
    max_gaussians: int,
    seed: int,
    device: Device | None = None,
) -> Gaussians:
    """Return a 3DGS model of `images` [H,W,3], one for each of the pair's training views.

    Parameters
    ----------
    pair : Pair
    images : sequence of array
        ``pair.scene`` or ``pair.message``.
    begin : Parameters
        Gaussians to start from.
    iterations, max_gaussians, seed, device
        As for `gspure train`.

    """
    snapshot = beginning(begin, seed)
    model = TrainableModel(snapshot.state, device=device)
    model.set_targets(images)
    extent = pair.dataset.extent
    schedule = Schedule.scaled(iterations)
    trainer = Trainer(model, pair.views, schedule, snapshot, extent=extent, max_gaussians=max_gaussians)
    for _ in watched(trainer, iterations, lambda: f"{model.count} Gaussians"):
        pass
    return as_gaussians(model.state().parameters)
