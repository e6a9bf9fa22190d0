"""Compression: a round trip through a web format."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from gspure.arrays import Float32, Float64, Indices
from gspure.attacks.attack import Attack, Rng
from gspure.attacks.attacked import Attacked, NotApplicable, require
from gspure.errors import InputError
from gspure.model import read_model, write_model
from gspure.model.compressed import CHUNK, PACKAGES, PACKED_PLY
from gspure.model.finite import drawable
from gspure.model.gaussians import COLOUR, CORE, Gaussians
from gspure.opencl.storage import morton_codes
from gspure.plugins import require_packages
from gspure.public_model import Columns

_SUFFIXES: Final = {"compressed_ply": PACKED_PLY, "spz": ".spz"}

_FORGED: Final = ("sog", "splat", "ksplat")  # written and read by GaussForge
_PACKAGES: Final = {**PACKAGES, "gaussforge": PACKAGES["gsply"]}


def compression(model: Gaussians, _rng: Rng, columns: Columns, *, codec: str = "compressed_ply") -> Attacked:
    """Write the model in a compressed format and read it back.

    Rows are first sorted along a space-filling curve, as converters do (`curve_order`). The `codec` is

    - ``compressed_ply``: PlayCanvas' compressed PLY, chunks of 256 rows, 10 to 11 bits per coordinate, 8 per colour;
    - ``spz``: Niantic's SPZ 3, 24 bits per coordinate, 8 per scale, opacity and coefficient;
    - ``sog``: PlayCanvas' SOG, 16 bits per coordinate, 256 scales and colours;
    - ``splat``: 8 bits per rotation and colour, no further harmonics;
    - ``ksplat``: 8 bits per colour.

    Source: what converters do. gsply (MIT) writes the first two, GaussForge (Apache-2.0) the others.
    """
    known = (*_SUFFIXES, *_FORGED)
    require("compression", "codec", codec, f"one of {', '.join(known)}", fits=codec in known)
    if not set(COLOUR) <= set(columns["colour"]):
        raise NotApplicable("compression", "the format holds spherical harmonics, not features")
    order = curve_order(np.nan_to_num(model.means.astype(np.float64), posinf=0.0, neginf=0.0))
    sorted_model = Attacked.copied(model, order).model
    try:
        decoded = _forged(sorted_model, codec) if codec in _FORGED else _decoded(sorted_model, _SUFFIXES[codec])
    except InputError as error:
        error.source = "attack compression"  # not the temporary file
        raise
    if codec == "sog":
        order = order[_places(sorted_model.means, decoded.means)]
        sorted_model = Attacked.copied(model, order).model
    zeros = np.zeros(len(model), np.float32)  # for spherical harmonics, which a .splat does not hold
    names = (*CORE, *COLOUR, *model.columns_named("f_rest_"))
    values = {name: decoded.table[name] if name in decoded.names else zeros for name in names}
    return Attacked(sorted_model.with_columns(values), order, len(model))


def _decoded(model: Gaussians, suffix: str) -> Gaussians:
    """Return a model after a round trip through a file of the suffix."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"model{suffix}"
        write_model(file, model)
        return read_model(file)


def _forged(model: Gaussians, codec: str) -> Gaussians:
    """Return a model after a round trip through GaussForge (Apache-2.0), an optional package."""
    require_packages({"gaussforge": _PACKAGES["gaussforge"]}, "attack compression")
    import gaussforge

    forge = gaussforge.GaussForge()
    with TemporaryDirectory() as folder:
        file = Path(folder) / "model.ply"
        write_model(file, drawable(model, codec))
        packed = forge.convert(file.read_bytes(), "ply", codec)["data"]
        file.write_bytes(forge.convert(packed, codec, "ply")["data"])
        return read_model(file)


def _places(before: Float32, after: Float32) -> Indices:
    """Return the row in `before` [K,3] of each centre of `after` [K,3], which an encoder sorted and rounded.

    Centres are compared on the grid of SOG; centres that share a grid cell are interchangeable.
    """
    logs_before = _signed_logs(before)
    logs_after = _signed_logs(after)
    low = logs_after.min(axis=0)
    high = logs_after.max(axis=0)
    steps = np.maximum(high - low, np.finfo(np.float32).tiny) / 65535
    order_before = np.lexsort(np.rint((logs_before - low) / steps).T)
    order_after = np.lexsort(np.rint((logs_after - low) / steps).T)
    places = np.empty(len(after), np.intp)
    places[order_after] = order_before
    return places


def _signed_logs(means: Float32) -> Float64:
    """Return sign(x) log(1 + abs(x)) of centres [K,3], the coordinates that SOG quantizes."""
    coordinates = means.astype(np.float64)
    logs: Float64 = np.sign(coordinates) * np.log1p(np.abs(coordinates))
    return logs


def curve_order(means: Float64) -> Indices:
    """Return the rows of `means` [K,3], finite, along the Morton curve of PlayCanvas' splat-transform.

    Its cells divide the bounding box. If a cell has more rows than a `CHUNK`, these are sorted again within their own
    bounding box. So a few far rows do not widen the value ranges of all chunks.
    """
    low = means.min(axis=0)
    high = means.max(axis=0)
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


ATTACKS = (Attack("compression", compression, _PACKAGES),)
