"""Compression: a round trip through a web format with gsply (MIT), an optional dependency."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from gspure.attacks.attack import Attack, Attacked, Rng, require
from gspure.errors import InputError
from gspure.model.gaussians import COLOUR, Gaussians
from gspure.opencl.storage import morton_order
from gspure.public_model import Columns

CODEC: Final = "compressed_ply"
PACKAGES: Final = {"gsply": "gspure[compression]"}


def compression(model: Gaussians, _rng: Rng, columns: Columns, *, codec: str = CODEC) -> Attacked:
    """Write the model in a compressed format and read it back.

    Rows are sorted along a space-filling curve first, as converters do: chunks of rows share a value range.

    Parameters
    ----------
    model : Gaussians
        With spherical harmonics: the formats cannot hold features.
    codec : {"compressed_ply", "spz"}
        PlayCanvas' compressed PLY (chunks of 256 rows, 10 to 11 bits per coordinate, 8 per colour), or Niantic's SPZ,
        version 3 (24 bits per coordinate, 8 per scale, opacity and coefficient).

    """
    require("compression", "codec", codec, f"one of {', '.join(_ROUND_TRIPS)}", fits=codec in _ROUND_TRIPS)
    if not set(COLOUR) <= set(columns["colour"]):
        raise InputError("attack compression", "colour", expected="columns f_dc_*", found="features")
    try:
        import gsply
    except ImportError as error:
        hint = f"pip install {PACKAGES['gsply']}"
        raise InputError(
            "attack compression", "gsply", expected="the package gsply", found=str(error), hint=hint
        ) from None
    order = morton_order(model.means).astype(np.intp)
    sorted_model = Attacked.copied(model, order).model
    read_back = _ROUND_TRIPS[codec](gsply, _as_parts(gsply, sorted_model))
    return Attacked(_with_parts(sorted_model, read_back), order, len(model))


def _as_parts(gsply: Any, model: Gaussians) -> Any:
    norms = np.linalg.norm(model.quats, axis=1, keepdims=True)
    return gsply.GSData.from_arrays(
        model.means,
        model.columns("scale_0", "scale_1", "scale_2"),
        model.quats / np.maximum(norms, np.finfo(np.float32).tiny),
        model.table["opacity"].copy(),
        model.sh_coeffs[:, 0],
        model.sh_coeffs[:, 1:],
        format="ply",
    )


def _with_parts(model: Gaussians, parts: Any) -> Gaussians:
    values = dict(zip("xyz", parts.means.T, strict=True))
    values |= {f"scale_{i}": column for i, column in enumerate(parts.scales.T)}
    values |= {f"rot_{i}": column for i, column in enumerate(parts.quats.T)}
    rest = [] if parts.shN is None else [parts.shN]
    coeffs = np.concatenate([parts.sh0[:, None], *rest], axis=1)
    return model.with_columns(values).with_appearance(parts.opacities.reshape(-1), coeffs)


def _compressed_ply(gsply: Any, parts: Any) -> Any:
    return gsply.decompress_from_bytes(gsply.compress_to_bytes(parts))


def _spz(gsply: Any, parts: Any) -> Any:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "model.spz"
        gsply.write_spz(path, parts)
        return gsply.read_spz(path)


_ROUND_TRIPS: Final[dict[str, Callable[[Any, Any], Any]]] = {"compressed_ply": _compressed_ply, "spz": _spz}


ATTACKS = (Attack("compression", compression, PACKAGES),)
