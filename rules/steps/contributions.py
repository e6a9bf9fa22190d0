"""Compute the contribution of every row to one part of the training views; views that are cached are left out."""

from pathlib import Path

from gspure.cameras.splits import read_split
from gspure.constants import Energy
from gspure.method.contributions import contribute, write_index
from gspure.opencl.device import choose_device
from gspure.schemes.registry import read_public_model
from gspure.workflow.step import run


def measure(
    model: Path, cameras: Path, index: Path, cache: Path, part: tuple[int, int], energy: Energy, scheme: str | None
) -> None:
    public = read_public_model(model, scheme).drawable(model)
    number, parts = part
    views = read_split(cameras, "train")[number - 1 :: parts]
    write_index(index, contribute(public, views, cache, device=choose_device(), energy=energy))


run(measure)
