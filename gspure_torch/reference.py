"""Some rows of the published model, in a key: with them, an extraction undoes a mix of features before it reads them.

::

    <key>/reference.ply     the rows; a key without this file reads features as they are
"""

from pathlib import Path
from typing import Final

import numpy as np

from gspure.model import Gaussians, read_model, write_model
from gspure.public_model import PublicModel
from gspure.schemes.matching import Model, unmixed

ROWS: Final = 512  # many times the number of features, which they determine; ours
_FILE: Final = "reference.ply"


class Reference:
    """Rows of the published model, or none."""

    def __init__(self, rows: Gaussians | None = None) -> None:
        self._rows = rows

    @classmethod
    def of(cls, public: PublicModel) -> "Reference":
        """Return `ROWS` rows of a model, evenly spaced in its file."""
        count = len(public.model)
        return cls(public.model[np.linspace(0, count - 1, min(count, ROWS)).astype(np.intp)])

    @classmethod
    def read(cls, folder: Path) -> "Reference":
        """Read the rows of a key, if it has any."""
        file = folder / _FILE
        return cls(read_model(file) if file.is_file() else None)

    def write(self, folder: Path) -> None:
        """Write the rows, if there are any."""
        if self._rows is not None:
            write_model(folder / _FILE, self._rows)

    def read_through(self, public: Model) -> Model:
        """Return the model with the basis of features of the rows."""
        return public if self._rows is None else unmixed(public, self._rows)


NO_REFERENCE: Final = Reference()
