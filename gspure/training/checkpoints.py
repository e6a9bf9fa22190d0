"""Checkpoints: everything that the rest of a run depends on, so that a killed run ends as it would have."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.artifacts import replacing
from gspure.errors import InputError
from gspure.opencl.trainable import Parameters, TrainState

_PARTS: Final = tuple(field.name for field in fields(TrainState))
_GROUPS: Final = tuple(field.name for field in fields(Parameters))


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A run at rest (`gspure.training.schedule.Schedule.rests`).

    Parameters
    ----------
    iteration : int
        Iterations done.
    state : TrainState
    unseen : tuple of int
        Training views that are still to come before all come again; the last is next.
    rng : dict
        State of the bit generator that all randomness comes from.

    """

    iteration: int
    state: TrainState
    unseen: tuple[int, ...]
    rng: Mapping[str, Any]


def write_checkpoint(path: Path, snapshot: Snapshot, settings: Mapping[str, Any]) -> None:
    """Write a snapshot and the settings of its run as .npz without pickle, whole or not at all."""
    run = {"iteration": snapshot.iteration, "unseen": snapshot.unseen, "rng": snapshot.rng, "settings": settings}
    arrays = {f"{part}.{group}": getattr(getattr(snapshot.state, part), group) for part in _PARTS for group in _GROUPS}
    with replacing(path) as temporary:
        np.savez(temporary, run=np.array(json.dumps(run)), **arrays)


def read_checkpoint(path: Path, settings: Mapping[str, Any]) -> Snapshot:
    """Read a snapshot of a run with these settings.

    Raises
    ------
    InputError
        The file is no checkpoint, or that of a run with other settings.

    """
    try:
        with Path(path).open("rb") as stream, zipfile.ZipFile(stream):  # np.load takes a lone array too
            stream.seek(0)
            with np.load(stream, allow_pickle=False) as archive:
                arrays: dict[str, NDArray[Any]] = dict(archive)
        run = json.loads(str(arrays.pop("run")))
        _require_same(path, run["settings"], settings)
        parts = [Parameters(*(arrays[f"{part}.{group}"] for group in _GROUPS)) for part in _PARTS]
        return Snapshot(run["iteration"], TrainState(*parts), tuple(run["unseen"]), run["rng"])
    except (KeyError, TypeError, ValueError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(path, "file", expected="a checkpoint of training", found=str(error)) from None


def _require_same(path: Path, stored: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
    for name, value in json.loads(json.dumps(wanted)).items():
        if stored.get(name) != value:
            hint = "leave out --resume to begin anew"
            raise InputError(path, name, expected=json.dumps(value), found=json.dumps(stored.get(name)), hint=hint)
