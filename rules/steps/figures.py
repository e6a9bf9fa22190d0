"""Draw a model and its pruning; with the owner's key, also measure and draw which rows hold the message."""

from pathlib import Path
from typing import Any

import numpy as np

from gspure.figures.clouds import Purified
from gspure.figures.gallery import draw_model
from gspure.files import Float32, load_array, save_array, write_json
from gspure.method.clusters import read_labels
from gspure.model.finite import undrawable_rows
from gspure.opencl.device import choose_device
from gspure.schemes.hidden_weight import hidden_weights, share_on_low
from gspure.schemes.registry import find_scheme, read_public_model
from gspure.workflow.step import run, views_of


def draw(model: Path, weights: Path, clusters: Path, cameras: Path, figures: Path, **how: Any) -> None:
    public = read_public_model(model, how["scheme"])
    omega = load_array(weights, dtype=np.float32, shape=(len(public.model),), least=0)
    message = measured(model, omega, figures.parents[1], how) if "key" in how else None
    factors = {name: how[name] for name in ("tau_c", "tau_n")}
    purified = Purified(public.drawable(model), read_labels(clusters), omega, message, **factors)
    draw_model(figures, purified, views_of(cameras, "all"), choose_device())


def measured(model: Path, omega: Float32, folder: Path, how: dict[str, Any]) -> Float32:
    """Return and write the weight of each row in views of the message, and its share on rows of low public weight."""
    scheme, public = find_scheme(how["scheme"]), read_public_model(model, how["scheme"])
    extraction = [*scheme.extractions][-1]  # the most complete
    views, key = views_of(Path(how["message_cameras"]), "train"), scheme.read_key(Path(how["key"]))
    message = np.zeros(len(omega), np.float32)
    drawn = np.delete(np.arange(len(omega)), undrawable_rows(public.model))
    settings = (how["energy"], choose_device(), how["reduction"])
    message[drawn] = hidden_weights(public.drawn(model), key, extraction, views, *settings)
    save_array(folder / "hidden.npy", message)
    low = share_on_low(omega, message, how["tau_n"]) if message.any() else None
    write_json(folder / "hidden.json", {"hidden_low_share": low})
    return message


run(draw)
