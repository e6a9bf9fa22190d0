"""Draw a model and its pruning; with the owner's key, also measure and draw which rows hold the message."""

from pathlib import Path
from typing import Any

import numpy as np

from gspure.arrays import Float32, load_array, save_array
from gspure.cameras import Camera
from gspure.cameras.splits import read_split
from gspure.figures.clouds import Purified
from gspure.figures.gallery import draw_model
from gspure.files import write_json
from gspure.method.clusters import read_labels
from gspure.model import Gaussians
from gspure.model.finite import undrawable_rows
from gspure.opencl.device import choose_device
from gspure.public_model import Rows
from gspure.schemes.hidden_weight import hidden_weights, share_on_low
from gspure.schemes.registry import find_scheme, read_public_model
from gspure.viewer.data import write_viewer
from gspure.workflow.step import run


def draw(model: Path, weights: Path, clusters: Path, cameras: Path, figures: Path, **how: Any) -> None:
    public = read_public_model(model, how["scheme"])
    omega = load_array(weights, dtype=np.float32, shape=(len(public.model),), least=0)
    known = {name: how[name] for name in ("tau_c", "tau_n")}
    if "key" in how:
        known |= measured(model, omega, figures.parents[1], how)
    purified = Purified(public.drawable(model), read_labels(clusters), omega, **known)
    views = read_split(cameras, "all")
    draw_model(figures, purified, views, choose_device())
    write_viewer(figures / "view.json", purified, views)


def measured(model: Path, omega: Float32, folder: Path, how: dict[str, Any]) -> dict[str, Any]:
    """Return and write the weight of each row in views of the message, and return the Gaussians that show it."""
    scheme, public = find_scheme(how["scheme"]), read_public_model(model, how["scheme"])
    names = [*scheme.extractions]  # the literal one first, the most complete last
    views, key = read_split(Path(how["message_cameras"]), "train"), scheme.read_key(Path(how["key"]))
    hidden = np.zeros(len(omega), np.float32)
    drawn = np.delete(np.arange(len(omega)), undrawable_rows(public.model))
    public, device = public.drawn(model), choose_device()
    hidden[drawn] = hidden_weights(public, key, names[-1], views, how["energy"], device, how["reduction"])
    save_array(folder / "hidden.npy", hidden)
    low = share_on_low(omega, hidden, how["tau_n"]) if hidden.any() else None
    write_json(folder / "hidden.json", {"hidden_low_share": low})

    def message(camera: Camera) -> tuple[Gaussians, Rows]:
        gaussians, rows = key.gaussians(public, camera, names[-1])
        return gaussians, drawn[rows]

    view = views[len(views) // 2]
    return {"hidden": hidden, "message": message, "extracted": lambda p: key.message(p, names[0], device)(view)}


run(draw)
