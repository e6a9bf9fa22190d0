"""Checkpoints: the complete state of a run, so that a resumed run gives the same bits."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final

import numpy as np

from gspure.errors import InputError, reading
from gspure.files import Kind, Shape, load_arrays, replacing
from gspure.opencl.trainable import Parameters, TrainState

_PARTS: Final = tuple(field.name for field in fields(TrainState))
_SHAPES: Final[dict[str, Shape]] = {
    "means": (None, 3),
    "quats": (None, 4),
    "log_scales": (None, 3),
    "opacity_logits": (None,),
    "sh_coeffs": (None, None, 3),
}
_CONTENT: Final = "a checkpoint of training"


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The state of a run between two densifications (`gspure.training.schedule.Schedule.rests`).

    `pending_views` are the training views left in the current pass over all of them; the last is next. `rng` is the
    state of the run's only bit generator.
    """

    iteration: int
    state: TrainState
    pending_views: tuple[int, ...]
    rng: Mapping[str, Any]


def write_checkpoint(path: Path, snapshot: Snapshot, settings: Mapping[str, Any]) -> None:
    """Write a snapshot and the settings of its run as .npz without pickle, whole or not at all."""
    run = {"iteration": snapshot.iteration, "unseen": snapshot.pending_views, "rng": snapshot.rng, "settings": settings}
    arrays = {f"{part}.{group}": getattr(getattr(snapshot.state, part), group) for part in _PARTS for group in _SHAPES}
    with replacing(path) as temporary:
        np.savez(temporary, run=np.array(json.dumps(run)), **arrays)


def read_checkpoint(path: Path, settings: Mapping[str, Any]) -> Snapshot:
    """Read a snapshot of a run with these settings.

    Raise `InputError` if the file is no checkpoint, or its run has other settings.
    """
    kinds: dict[str, Kind] = {
        f"{part}.{group}": (np.float32, shape) for part in _PARTS for group, shape in _SHAPES.items()
    }
    arrays = load_arrays(path, kinds | {"run": (np.str_, ())}, _CONTENT)
    with reading(path, _CONTENT):
        run = json.loads(str(arrays["run"]))
        _require_same(path, run["settings"], settings)
        parts = [Parameters(*(arrays[f"{part}.{group}"] for group in _SHAPES)) for part in _PARTS]
        np.random.default_rng().bit_generator.state = run["rng"]  # raises what `reading` reports
        return Snapshot(run["iteration"], TrainState(*parts), tuple(run["unseen"]), run["rng"])


def _require_same(path: Path, stored: Mapping[str, Any], settings: Mapping[str, Any]) -> None:
    for name, value in json.loads(json.dumps(settings)).items():
        if stored.get(name) != value:
            hint = "delete it to begin anew, since --resume continues the same run only"
            raise InputError(path, name, expected=json.dumps(value), found=json.dumps(stored.get(name)), hint=hint)
