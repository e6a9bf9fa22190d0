"""Average the contributions over the views, and compute the opacity of every row."""

from pathlib import Path
from typing import Any

import numpy as np

from gspure.arrays import save_array
from gspure.cameras.splits import read_split
from gspure.method.contributions import read_contributions, read_index
from gspure.method.weights import accumulate, evenly_spread, few_in_view, require_in_view
from gspure.progress import warn
from gspure.schemes.registry import read_public_model
from gspure.workflow.step import run


def average(indices: list[Path], model: Path, cameras: Path, weights: Path, opacities: Path, **how: Any) -> None:
    public = read_public_model(model, how["scheme"]).drawable(model)
    count, cached = len(public.model), read_index(*indices)
    if how["views"]:
        cached = evenly_spread(cached, how["views"])
    omega = accumulate((read_contributions(file, count) for file in cached), count, how["reduction"])
    require_in_view(omega)
    save_array(weights, omega)
    save_array(opacities, public.opacities(read_split(cameras, "train")))
    for sentence in few_in_view(int(np.count_nonzero(omega)), count):
        warn(sentence)


run(average)
