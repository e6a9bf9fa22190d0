"""Draw a model and its pruning; with the owner's key, also measure and draw which rows hold the message."""

from pathlib import Path
from typing import Any

import numpy as np

from gspure.figures.clouds import Purified
from gspure.figures.gallery import draw_model
from gspure.files import load_array, save_array, write_json
from gspure.method.clusters import read_labels
from gspure.model.finite import undrawable_rows
from gspure.opencl.device import choose_device
from gspure.schemes.hidden_weight import hidden_weights, share_on_low
from gspure.schemes.registry import find_scheme, read_public_model
from gspure.workflow.step import run, views_of


def draw(
    model: Path,
    weights: Path,
    clusters: Path,
    cameras: Path,
    figures: Path,
    settings: dict[str, Any],
    scheme: str | None = None,
    key: Path | None = None,
    message_cameras: Path | None = None,
    hidden: Path | None = None,
    share: Path | None = None,
) -> None:
    public = read_public_model(model, scheme)
    omega = load_array(weights, dtype=np.float32, shape=(len(public.model),), least=0)
    message = None
    if scheme and key and message_cameras and hidden and share:
        known = find_scheme(scheme)
        extraction = [*known.extractions][-1]  # the most complete
        views = views_of(message_cameras, "train")
        drawn = np.delete(np.arange(len(omega)), undrawable_rows(public.model))
        message = np.zeros(len(omega), np.float32)
        rest = (known.read_key(key), extraction, views, settings["energy"], choose_device(), settings["reduction"])
        message[drawn] = hidden_weights(public.drawn(model), *rest)
        save_array(hidden, message)
        low = share_on_low(omega, message, settings["tau_n"]) if message.any() else None
        write_json(share, {"hidden_low_share": low})
    factors = {name: settings[name] for name in ("tau_c", "tau_n")}
    purified = Purified(public.drawable(model), read_labels(clusters), omega, message, **factors)
    draw_model(figures, purified, views_of(cameras, "all"), choose_device())


run(draw)
