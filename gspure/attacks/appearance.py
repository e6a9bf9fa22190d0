"""Attacks that change how rows look: scaling, rounding, fewer spherical harmonics."""

from typing import Annotated, Final

import numpy as np

from gspure.attacks.attack import Rng, named
from gspure.attacks.attacked import Attacked, NotApplicable, require, select_columns
from gspure.attacks.strength import Strength
from gspure.constants import MAX_SH_DEGREE
from gspure.files import Float32
from gspure.model.activations import LEAST_OPACITY, logit
from gspure.model.gaussians import Gaussians
from gspure.progress import warn
from gspure.public_model import ATTRIBUTES, Columns
from gspure.settings import Amount, Range

FACTOR: Final = 1.2  # scale of the features; ours: the paper says "amplifies", without a value

BITS: Final = 8
QUANTIZED: Final = "colour,opacity,scale,rotation"  # ours: formats keep 16 bits and more for positions
HALF: Final = 16  # bits of IEEE-754 half precision


def feature_scaling(
    model: Gaussians, _rng: Rng, columns: Columns, *, factor: Amount = FACTOR, attributes: str = "colour"
) -> Attacked:
    """Multiply attributes of every row by `factor`, 0 or more (paper, §Intuitive Methods, 2).

    Attributes are ``colour`` (stored coefficients or features), ``base_colour``, and ``opacity`` (the activated one).
    The paper scales both in §Intuitive Methods and colour alone in §Baselines, the default here.
    """
    names = select_columns("feature_scaling", columns, attributes, ("colour", "base_colour", "opacity"))
    scaled = {name: model.table[name] * np.float32(factor) for name in names}
    if "opacity" in scaled:
        scaled["opacity"] = logit(model.opacities.astype(np.float64) * factor, LEAST_OPACITY)
    return Attacked.changed(model, scaled)


def quantize(
    model: Gaussians,
    _rng: Rng,
    columns: Columns,
    *,
    bits: Annotated[int, Range(1, HALF)] = BITS,
    attributes: str = QUANTIZED,
) -> Attacked:
    """Round stored values of some `ATTRIBUTES` to few bits, as files for the web do.

    16 `bits` are half precision; greater numbers become its largest, with a warning. 1 to 8 are 2^bits equally spaced
    levels between a column's extremes, so one extreme value coarsens all others.
    """
    require("quantize", "bits", bits, "1 to 8, or 16", fits=bits in {*range(1, 9), HALF})
    names = select_columns("quantize", columns, attributes, ATTRIBUTES)
    if bits == HALF:
        return Attacked.changed(model, {name: _to_half(name, model.table[name]) for name in names})
    return Attacked.changed(model, {name: _to_levels(model.table[name], 2**bits) for name in names})


def sh_truncation(model: Gaussians, _rng: Rng, *, degree: Annotated[int, Range(0, MAX_SH_DEGREE)] = 0) -> Attacked:
    """Set the spherical harmonics above `degree` to zero; the columns stay, so that the model reads as before.

    Refused for models without harmonics above `degree`.
    """
    most = model.sh_degree - 1
    if degree > most:
        raise NotApplicable("sh_truncation", f"no harmonics above degree {degree}")
    rest = model.columns_named("f_rest_")
    per_channel = len(rest) // 3  # channel-major: number i holds coefficient 1 + i % per_channel
    above = [name for i, name in enumerate(rest) if 1 + i % per_channel >= (degree + 1) ** 2]
    return Attacked.changed(model, dict.fromkeys(above, np.zeros(len(model), np.float32)))


def _to_half(name: str, values: Float32) -> Float32:
    """Return the nearest half-precision numbers of a column; overflow saturates, with a warning."""
    largest = np.finfo(np.float16).max
    if beyond := np.count_nonzero(np.abs(values) > largest):
        affected = f"{beyond} of {len(values)} rows beyond half precision are set to ±{largest}"
        warn(f"attack quantize: {name}: {affected}")
    return np.clip(values, -largest, largest).astype(np.float16).astype(np.float32)


def _to_levels(values: Float32, levels: int) -> Float32:
    """Return the nearest of `levels` equally spaced numbers between the extremes of `values`."""
    if not len(values) or values.min() == values.max():
        return values
    least, greatest = float(values.min()), float(values.max())
    step = (greatest - least) / (levels - 1)
    rounded: Float32 = (least + step * np.rint((values.astype(np.float64) - least) / step)).astype(np.float32)
    return rounded


ATTACKS = named(
    {feature_scaling: Strength("factor", 1.01, 10.0, "log"), quantize: Strength("bits", 8, 1), sh_truncation: None}
)
