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

    Rows are sorted along a space-filling curve first, as converters do (`curve_order`). The `codec` is compressed_ply,
    PlayCanvas' compressed PLY (chunks of 256 rows, 10 to 11 bits per coordinate, 8 per colour), spz, Niantic's SPZ 3
    (24 bits per coordinate, 8 per scale, opacity and coefficient), sog, PlayCanvas' SOG (16 bits per coordinate, 256
    scales and colours), splat (8 bits per rotation and colour, no further harmonics), or ksplat (8 bits per colour).
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
    nothing = np.zeros(len(model), np.float32)  # of harmonics that a .splat does not hold
    names = (*CORE, *COLOUR, *model.columns_named("f_rest_"))
    values = {name: decoded.table[name] if name in decoded.names else nothing for name in names}
    return Attacked(sorted_model.with_columns(values), order, len(model))


def _decoded(model: Gaussians, suffix: str) -> Gaussians:
    """Return a model as a file of the suffix holds it."""
    with TemporaryDirectory() as folder:
        write_model(file := Path(folder) / f"model{suffix}", model)
        return read_model(file)


def _forged(model: Gaussians, codec: str) -> Gaussians:
    """Return a model after a round trip through GaussForge (Apache-2.0), an optional package."""
    require_packages({"gaussforge": _PACKAGES["gaussforge"]}, "attack compression")
    import gaussforge

    forge = gaussforge.GaussForge()
    with TemporaryDirectory() as folder:
        write_model(file := Path(folder) / "model.ply", drawable(model, codec))
        packed = forge.convert(file.read_bytes(), "ply", codec)["data"]
        file.write_bytes(forge.convert(packed, codec, "ply")["data"])
        return read_model(file)


def _places(before: Float32, after: Float32) -> Indices:
    """Return the row of `before` [K,3] that each centre of `after` [K,3] was, where an encoder sorted and rounded them.

    Centres are compared on the grid of SOG; of those in one cell, any may have been any.
    """
    logs = [np.sign(means) * np.log1p(np.abs(means)) for means in (before.astype(np.float64), after.astype(np.float64))]
    low, high = logs[1].min(axis=0), logs[1].max(axis=0)
    steps = np.maximum(high - low, np.finfo(np.float32).tiny) / 65535
    sources, targets = (np.lexsort(np.rint((log - low) / steps).T) for log in logs)
    places = np.empty(len(after), np.intp)
    places[targets] = sources
    return places


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


ATTACKS = (Attack("compression", compression, _PACKAGES),)
