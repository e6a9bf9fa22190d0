"""Average the contributions over the views, and compute the opacity of every row."""

from pathlib import Path

import numpy as np

from gspure.arrays import save_array
from gspure.cameras.splits import read_split
from gspure.method.contributions import read_contributions, read_index
from gspure.method.weights import Reduction, accumulate, evenly_spread, few_in_view, require_in_view
from gspure.model import model_file
from gspure.progress import warn
from gspure.provenance import bind_rows
from gspure.schemes.registry import read_public_model
from gspure.workflow.step import run


def average(
    indices: tuple[Path, ...],
    model: Path,
    cameras: Path,
    weights: Path,
    opacities: Path,
    reduction: Reduction,
    views: int | None,
    scheme: str | None,
) -> None:
    public = read_public_model(model, scheme).drawable(model)
    count = len(public.model)
    cached = read_index(*indices)
    if views:
        cached = evenly_spread(cached, views)
    omega = accumulate((read_contributions(file, count) for file in cached), count, reduction)
    require_in_view(omega)
    save_array(weights, omega)
    save_array(opacities, public.opacities(read_split(cameras, "train")))
    bind_rows(model_file(model), weights, opacities)
    for sentence in few_in_view(int(np.count_nonzero(omega)), count):
        warn(sentence)


run(average)
