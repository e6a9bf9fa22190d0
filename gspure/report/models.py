"""The figures of one model and its pruning, and the data of its 3-D view."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gspure.arrays import load_array, save_array
from gspure.cameras.splits import read_split
from gspure.evaluation.plan import Owner
from gspure.evaluation.revealing import reveal
from gspure.figures.clouds import Purified
from gspure.figures.gallery import draw_model
from gspure.files import write_json
from gspure.method.clusters import read_labels
from gspure.method.settings import MethodSettings
from gspure.opencl.device import Device
from gspure.schemes.hidden_weight import share_on_low
from gspure.schemes.registry import read_public_model
from gspure.viewer.data import write_viewer


class ModelFiles(NamedTuple):
    """A public model, and what GSPure measured and decided about it."""

    model: Path
    weights: Path
    clusters: Path
    cameras: Path


def draw(
    files: ModelFiles, folder: Path, settings: MethodSettings, scheme: str | None, owner: Owner | None, device: Device
) -> None:
    """Draw a model in a folder; with its `owner`, also write which rows hold the message, two folders above."""
    public = read_public_model(files.model, scheme)
    weights = load_array(files.weights, dtype=np.float32, shape=(len(public.model),), least=0)
    labels = read_labels(files.clusters)
    tau_n = settings.factors.tau_n
    purified = Purified(public.drawable(files.model), labels, weights, tau_c=settings.factors.tau_c, tau_n=tau_n)
    if owner:
        revealed = reveal(files.model, owner, settings, device)
        place = folder.parents[1]
        save_array(place / "hidden.npy", revealed.hidden)
        low_share = share_on_low(weights, revealed.hidden, tau_n) if revealed.hidden.any() else None
        write_json(place / "hidden.json", {"hidden_low_share": low_share})
        purified = replace(purified, **revealed._asdict())
    views = read_split(files.cameras, "all")
    draw_model(folder, purified, views, device)
    write_viewer(folder / "view.json", purified, views)
