"""The owner's key to a planted message, and the truth about every row.

::

    <key>/planted.npz         positions of all rows of the public model; private opacity and colour of those that carry
    <key>/message_rows.npy    the rows that carry the message
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from gspure.artifacts import load_array, load_arrays, save_array, save_arrays
from gspure.artifacts.arrays import Kind
from gspure.cameras.camera import Camera
from gspure.errors import InputError
from gspure.evaluation.recall import MESSAGE_ROWS
from gspure.files import Bools, Float32
from gspure.model import Gaussians
from gspure.opencl.device import Device
from gspure.public_model import PublicModel, RenderView, Rows
from gspure.renderer import Renderer
from gspure.schemes.scheme import Key

_FILE: Final = "planted.npz"
_ARRAYS: Final[dict[str, Kind]] = {
    "positions": (np.float32, (None, 3)),
    "opacity": (np.float32, (None,)),
    "f_dc": (np.float32, (None, 3)),
}


@dataclass(frozen=True, eq=False)
class PlantedKey(Key):
    """What is private of the M rows that carry a message.

    `message_rows` [K] is true where a row of the public model carries the message, and `positions` [K,3] are the
    centres of all rows, by which an attacked model is matched. `opacity` [M] is the private logit, `f_dc` [M,3] the
    private zeroth spherical-harmonic coefficient.
    """

    message_rows: Bools
    positions: Float32
    opacity: Float32
    f_dc: Float32

    def message(self, public: PublicModel, extraction: str, device: Device | None = None) -> RenderView:  # noqa: ARG002
        """Return the message's view."""
        renderer = Renderer(self._revealed(public)[0], device)
        return renderer.image

    def gaussians(self, public: PublicModel, camera: Camera, extraction: str) -> tuple[Gaussians, Rows]:  # noqa: ARG002
        """Return the surviving rows of the message with their private opacity and colour, and their rows."""
        return self._revealed(public)

    def wrong(self, rng: np.random.Generator) -> PlantedKey:
        """Return a key to as many other rows, drawn from all, with the private values in another order."""
        order = rng.permutation(len(self.opacity))
        return PlantedKey(rng.permutation(self.message_rows), self.positions, self.opacity[order], self.f_dc[order])

    def write(self, folder: Path) -> None:
        """Write both files."""
        save_array(folder / MESSAGE_ROWS, self.message_rows)
        save_arrays(folder / _FILE, {name: getattr(self, name) for name in _ARRAYS})

    @staticmethod
    def read(folder: Path) -> PlantedKey:
        """Read a key.

        Raise `InputError` if a file is missing or unreadable, or an array is of another type or shape, or not
        finite.
        """
        path = Path(folder) / _FILE
        arrays = load_arrays(path, _ARRAYS, "a key to a planted message")
        message_rows = load_array(Path(folder) / MESSAGE_ROWS, dtype=np.bool_, shape=(len(arrays["positions"]),))
        for name in ("opacity", "f_dc"):
            if len(arrays[name]) != message_rows.sum():
                expected = f"{message_rows.sum()} entries, one per row that carries the message"
                raise InputError(path, name, expected=expected, found=str(len(arrays[name])))
        return PlantedKey(message_rows, **{name: arrays[name] for name in _ARRAYS})

    def _revealed(self, public: PublicModel) -> tuple[Gaussians, Rows]:
        """Return the message that a model still holds, and its rows there.

        A row carries the message if its position is that of such a row, bit for bit; rows may be missing or permuted.
        Geometry is the model's own.
        """
        if public.model.sh_degree < 0:
            raise InputError("public model", "f_dc_0", expected="spherical-harmonic colour", found="none")
        known = {position.tobytes(): i for i, position in enumerate(self.positions[self.message_rows])}
        places = np.array([known.get(position.tobytes(), -1) for position in public.model.means], np.intp)
        rows = np.flatnonzero(places >= 0)
        survivors, places = public.model[places >= 0], places[rows]
        columns = {name: np.zeros(len(rows), np.float32) for name in survivors.columns_named("f_rest_")}
        columns |= {f"f_dc_{i}": self.f_dc[places, i] for i in range(3)}
        return survivors.with_columns(columns | {"opacity": self.opacity[places]}), rows
