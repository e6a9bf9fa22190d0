"""Draw a model and its pruning; with the owner's key, also measure and draw which rows hold the message."""

from dataclasses import replace
from pathlib import Path

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
from gspure.opencl.device import choose_device
from gspure.schemes.hidden_weight import share_on_low
from gspure.schemes.registry import read_public_model
from gspure.viewer.data import write_viewer
from gspure.workflow.step import run


def draw(
    model: Path,
    weights: Path,
    clusters: Path,
    cameras: Path,
    figures: Path,
    settings: MethodSettings,
    scheme: str | None,
    owner: Owner | None,
) -> None:
    public = read_public_model(model, scheme)
    omega = load_array(weights, dtype=np.float32, shape=(len(public.model),), least=0)
    factors = settings.factors
    purified = Purified(public.drawable(model), read_labels(clusters), omega, tau_c=factors.tau_c, tau_n=factors.tau_n)
    if owner:
        revealed = reveal(model, owner, settings, choose_device())
        folder = figures.parents[1]
        save_array(folder / "hidden.npy", revealed.hidden)
        low = share_on_low(omega, revealed.hidden, factors.tau_n) if revealed.hidden.any() else None
        write_json(folder / "hidden.json", {"hidden_low_share": low})
        purified = replace(purified, **revealed._asdict())
    views = read_split(cameras, "all")
    draw_model(figures, purified, views, choose_device())
    write_viewer(figures / "view.json", purified, views)


run(draw)
