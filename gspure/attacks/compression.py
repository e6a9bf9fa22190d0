"""Compression: a round trip through a web format."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from gspure.attacks.attack import Attack, Rng
from gspure.attacks.attacked import Attacked, NotApplicable, require
from gspure.errors import InputError
from gspure.files import Float64, Indices
from gspure.model import read_model, write_model
from gspure.model.compressed import CHUNK, PACKAGES, PACKED_PLY
from gspure.model.gaussians import COLOUR, CORE, Gaussians
from gspure.opencl.storage import morton_codes
from gspure.public_model import Columns

_SUFFIXES: Final = {"compressed_ply": PACKED_PLY, "spz": ".spz"}


def compression(model: Gaussians, _rng: Rng, columns: Columns, *, codec: str = "compressed_ply") -> Attacked:
    """Write the model in a compressed format and read it back.

    Rows are sorted along a space-filling curve first, as converters do (`curve_order`). The `codec` is compressed_ply,
    PlayCanvas' compressed PLY (chunks of 256 rows, 10 to 11 bits per coordinate, 8 per colour), or spz, Niantic's SPZ 3
    (24 bits per coordinate, 8 per scale, opacity and coefficient).
    """
    require("compression", "codec", codec, f"one of {', '.join(_SUFFIXES)}", fits=codec in _SUFFIXES)
    if not set(COLOUR) <= set(columns["colour"]):
        raise NotApplicable("compression", "the format holds spherical harmonics, not features")
    order = curve_order(np.nan_to_num(model.means.astype(np.float64), posinf=0.0, neginf=0.0))
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


def curve_order(means: Float64) -> Indices:
    """Return the rows of `means` [K,3], finite, along the Morton curve of PlayCanvas' splat-transform.

    Its cells span the bounding box. Rows of one cell that fill more than a `CHUNK` are sorted again, within their own
    box, so that far rows do not spoil the chunks of the others, which share a value range.
    """
    low, high = means.min(axis=0), means.max(axis=0)
    if (high - low).max() <= np.finfo(np.float32).tiny:  # one cell
        return np.arange(len(means))
    codes = morton_codes(means, low, high)
    order = np.argsort(codes, kind="stable")
    ends = np.append(np.flatnonzero(np.diff(codes[order])) + 1, len(order))
    starts = np.append(0, ends[:-1])
    long = ends - starts > CHUNK
    for start, end in zip(starts[long], ends[long], strict=True):
        cell = order[start:end]
        order[start:end] = cell[curve_order(means[cell])]
    return order


ATTACKS = (Attack("compression", compression, PACKAGES),)
