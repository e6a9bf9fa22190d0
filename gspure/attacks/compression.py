"""Compression: a round trip through a web format."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from gspure.attacks.attack import Attack, Attacked, Rng, require
from gspure.errors import InputError
from gspure.model import read_model, write_model
from gspure.model.compressed.writing import PACKAGES, PACKED_PLY, SPZ
from gspure.model.gaussians import COLOUR, CORE, Gaussians
from gspure.opencl.storage import morton_order
from gspure.public_model import Columns

_SUFFIXES: Final = {"compressed_ply": PACKED_PLY, "spz": SPZ}


def compression(model: Gaussians, _rng: Rng, columns: Columns, *, codec: str = "compressed_ply") -> Attacked:
    """Write the model in a compressed format and read it back.

    Rows are sorted along a space-filling curve first, as converters do: chunks of rows share a value range. The `codec`
    is compressed_ply, PlayCanvas' compressed PLY (chunks of 256 rows, 10 to 11 bits per coordinate, 8 per colour), or
    spz, Niantic's SPZ, version 3 (24 bits per coordinate, 8 per scale, opacity and coefficient). Both hold spherical
    harmonics, but no features.
    """
    require("compression", "codec", codec, f"one of {', '.join(_SUFFIXES)}", fits=codec in _SUFFIXES)
    if not set(COLOUR) <= set(columns["colour"]):
        raise InputError("attack compression", "colour", expected="columns f_dc_*", found="features")
    order = morton_order(model.means).astype(np.intp)
    sorted_model = Attacked.copied(model, order).model
    try:
        with TemporaryDirectory() as folder:
            file = Path(folder) / f"model{_SUFFIXES[codec]}"
            write_model(file, sorted_model)
            table = read_model(file).table
    except InputError as error:
        error.source = "attack compression"  # not the temporary file
        raise
    names = (*CORE, *COLOUR, *model.columns_named("f_rest_"))
    return Attacked(sorted_model.with_columns({name: table[name] for name in names}), order, len(model))


ATTACKS = (Attack("compression", compression, PACKAGES),)
