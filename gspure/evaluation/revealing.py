"""With the owner's key: which rows of a public model hold the message, and what they show."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gspure.arrays import Float32
from gspure.cameras import Camera
from gspure.cameras.splits import read_split
from gspure.evaluation.plan import Owner
from gspure.method.settings import MethodSettings
from gspure.model import Gaussians
from gspure.model.finite import undrawable_rows
from gspure.opencl.device import Device
from gspure.public_model import PublicModel, Rows
from gspure.schemes.hidden_weight import hidden_weights
from gspure.schemes.registry import find_scheme, read_public_model


class Revealed(NamedTuple):
    """The weight [K] of each row in views of the message, and the Gaussians and the picture that show it."""

    hidden: Float32
    message: Callable[[Camera], tuple[Gaussians, Rows]]
    extracted: Callable[[PublicModel], Float32]


def reveal(model: Path, owner: Owner, settings: MethodSettings, device: Device) -> Revealed:
    """Return what a key reveals of a public model; weights are measured as those of the scene."""
    scheme = find_scheme(owner.scheme)
    whole = read_public_model(model, owner.scheme)
    public = whole.drawn(model)
    key = scheme.read_key(owner.key)
    views = read_split(owner.message_cameras, "train")
    extractions = [*scheme.extractions]
    first = extractions[0]  # as published
    last = extractions[-1]  # the most complete one
    drawn = np.delete(np.arange(len(whole.model)), undrawable_rows(whole.model))
    hidden = np.zeros(len(whole.model), np.float32)
    hidden[drawn] = hidden_weights(public, key, last, views, settings.energy, device, settings.reduction)

    def message(camera: Camera) -> tuple[Gaussians, Rows]:
        gaussians, rows = key.gaussians(public, camera, last)
        return gaussians, drawn[rows]

    def extracted(shown: PublicModel) -> Float32:
        return key.message(shown, first, device)(views[len(views) // 2])

    return Revealed(hidden, message, extracted)
