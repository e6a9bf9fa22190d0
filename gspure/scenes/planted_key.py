"""The owner's key to a planted message, and the message that it reveals in a public or attacked model."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gspure.artifacts import load_arrays, save_arrays
from gspure.artifacts.arrays import Kind
from gspure.errors import InputError
from gspure.model.gaussians import Gaussians

Float32 = NDArray[np.float32]

_ARRAYS: dict[str, Kind] = {
    "rows": (np.int64, (None,)),
    "positions": (np.float32, (None, 3)),
    "opacity": (np.float32, (None,)),
    "f_dc": (np.float32, (None, 3)),
}


@dataclass(frozen=True, eq=False)
class PlantedKey:
    """What is private of the M Gaussians that carry a message.

    Parameters
    ----------
    rows : int64 [M]
        Their rows in the public model, ascending.
    positions : float32 [M,3]
        Their centres, by which they are found again in an attacked model.
    opacity : float32 [M]
        Private opacity, logit.
    f_dc : float32 [M,3]
        Private colour: the zeroth spherical-harmonic coefficient.

    """

    rows: NDArray[np.int64]
    positions: Float32
    opacity: Float32
    f_dc: Float32


def reveal(attacked: Gaussians, key: PlantedKey) -> Gaussians:
    """Return the message that a model still holds: its surviving carriers, with their private opacity and colour.

    A Gaussian is a carrier when its position is one of the key's, bit for bit; so rows may be missing, or in any order.
    Geometry is the model's own.
    """
    place = {position.tobytes(): i for i, position in enumerate(key.positions)}
    found = np.array([place.get(position.tobytes(), -1) for position in attacked.means], np.intp)
    carriers = attacked.subset(found >= 0)
    private = found[found >= 0]
    columns = {name: np.zeros(len(carriers), np.float32) for name in carriers.columns_named("f_rest_")}
    columns |= {f"f_dc_{i}": key.f_dc[private, i] for i in range(3)}
    return carriers.with_columns(columns | {"opacity": key.opacity[private]})


def write_key(path: Path, key: PlantedKey) -> None:
    """Write a key as .npz without pickle, whole or not at all."""
    save_arrays(path, asdict(key))


def read_key(path: Path) -> PlantedKey:
    """Read a key that `write_key` wrote.

    Raises
    ------
    InputError
        The file is missing or no .npz, or an array is missing, of another type or shape, or not finite.

    """
    arrays = load_arrays(path, _ARRAYS, "the owner's key, as .npz")
    for name, array in arrays.items():
        if len(array) != len(arrays["rows"]):
            raise InputError(path, name, expected=f"{len(arrays['rows'])} entries, as rows", found=str(len(array)))
    return PlantedKey(**{field.name: arrays[field.name] for field in fields(PlantedKey)})
