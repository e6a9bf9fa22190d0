"""Draw a model and its pruning; with the owner's key, also measure and draw which rows hold the message."""

from pathlib import Path

from gspure.evaluation.plan import Owner
from gspure.method.settings import MethodSettings
from gspure.opencl.device import choose_device
from gspure.report.models import ModelFiles, draw
from gspure.workflow.step import run


def draw_files(
    model: Path,
    weights: Path,
    clusters: Path,
    cameras: Path,
    figures: Path,
    settings: MethodSettings,
    scheme: str | None,
    owner: Owner | None,
) -> None:
    draw(ModelFiles(model, weights, clusters, cameras), figures, settings, scheme, owner, choose_device())


run(draw_files)
