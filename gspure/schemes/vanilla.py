"""Ordinary training of one of a pair's scenes: clean models, and the base of simple schemes."""

from gspure.model import Gaussians
from gspure.opencl.device import Device
from gspure.opencl.trainable import Parameters, TrainableModel
from gspure.schemes.pair import Capture
from gspure.training.monitor import watched
from gspure.training.output import as_gaussians
from gspure.training.schedule import Schedule
from gspure.training.trainer import Trainer, beginning


def train(
    capture: Capture,
    begin: Parameters,
    *,
    iterations: int,
    max_gaussians: int,
    seed: int,
    device: Device | None = None,
) -> Gaussians:
    """Return a 3DGS model of a pair's scene or message; the other parameters are those of `gspure train`."""
    snapshot = beginning(begin, seed)
    model = TrainableModel(snapshot.state, device=device)
    model.set_targets(capture.images)
    extent = capture.dataset.extent
    schedule = Schedule.scaled(iterations)
    trainer = Trainer(model, capture.views, schedule, snapshot, extent=extent, max_gaussians=max_gaussians)
    for _ in watched(trainer, iterations, lambda: f"{model.count} Gaussians"):
        pass
    return as_gaussians(model.state().parameters)
