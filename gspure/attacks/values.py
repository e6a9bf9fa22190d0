"""Attacks that change stored values: noise, scaling, rounding, fewer spherical harmonics."""

from typing import Annotated, Final

import numpy as np

from gspure.arrays import Float32
from gspure.attacks.attack import Rng, named
from gspure.attacks.attacked import Attacked, NotApplicable, require, require_attribute, select_columns
from gspure.attacks.geometry import radius
from gspure.attacks.strength import Strength
from gspure.constants import MAX_SH_DEGREE
from gspure.model.gaussians import LEAST_OPACITY, Gaussians, logit
from gspure.public_model import ATTRIBUTES, Columns
from gspure.settings import Amount, Range

SIGMA: Final = 0.1  # standard deviation of attribute noise, in units of the stored values; ours: the paper names none
OPACITY_SIGMA: Final = 0.1  # relative to each opacity; ours: the middle of the published range, 0.05 to 0.2
POSITION_SIGMA: Final = 0.005  # in radii of the model; ours: the middle of the published range, 0.001 to 0.01
FACTOR: Final = 1.2  # scale of the features; ours: the paper says "amplifies", without a value
BITS: Final = 8
QUANTIZED: Final = "colour,opacity,scale,rotation"  # ours: formats keep 16 bits and more for positions
HALF: Final = 16  # bits of IEEE-754 half precision
EDITED: Final = 0.02  # deviation of noise on view-dependent colour, in units of the stored values; ours
COLOURS: Final = ("colour", "base_colour", "opacity")


def gaussian_noise(
    model: Gaussians, rng: Rng, columns: Columns, *, sigma: Amount = SIGMA, attributes: str = "colour"
) -> Attacked:
    """Add independent Gaussian noise of deviation `sigma` to stored attributes of every row.

    `sigma` is in stored units, the same for every column. `attributes` are ``colour`` (spherical harmonics or features:
    the paper's "photometric features"), ``base_colour`` (harmonics of degree 0, or all features), and ``opacity`` (the
    logit), separated by commas.

    Source: the GSPure paper, §Intuitive Methods, 3, without a strength; the default is ours.
    """
    names = select_columns("gaussian_noise", columns, attributes, COLOURS)

    def noisy(column: Float32) -> Float32:
        changed: Float32 = (column + sigma * rng.standard_normal(len(model))).astype(np.float32)
        return changed

    return Attacked.changed(model, {name: noisy(model.table[name]) for name in names})


def opacity_noise(model: Gaussians, rng: Rng, columns: Columns, *, sigma: Amount = OPACITY_SIGMA) -> Attacked:
    """Multiply every opacity by an independent 1 + `sigma` ε, ε standard normal, and clip the result to 0 to 1.

    Source: published tests of watermarks, with a `sigma` of 0.05 to 0.2.
    """
    require_attribute("opacity_noise", columns, "opacity")
    noisy = model.opacities * (1 + sigma * rng.standard_normal(len(model)))
    return Attacked.changed(model, {"opacity": logit(noisy, LEAST_OPACITY)})


def position_noise(model: Gaussians, rng: Rng, *, sigma: Amount = POSITION_SIGMA) -> Attacked:
    """Move every centre along each axis by Gaussian noise whose deviation is `sigma` radii of the model.

    Source: published tests of watermarks, with a `sigma` of 0.001 to 0.01.
    """
    moved = model.means + sigma * radius(model) * rng.standard_normal((len(model), 3))
    return Attacked.changed(model, dict(zip("xyz", moved.astype(np.float32).T, strict=True)))


def feature_scaling(
    model: Gaussians, _rng: Rng, columns: Columns, *, factor: Amount = FACTOR, attributes: str = "colour"
) -> Attacked:
    """Multiply attributes of every row by `factor`, 0 or more.

    `attributes` are ``colour`` (stored coefficients or features), ``base_colour`` (harmonics of degree 0, or all
    features), and ``opacity`` (the activated one), separated by commas.

    Source: the GSPure paper. It scales colour and opacity in §Intuitive Methods, 2, and colour alone in §Baselines, the
    default here. It states no factor; the default is ours.
    """
    names = select_columns("feature_scaling", columns, attributes, COLOURS)
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
    """Round stored values of some attributes to few bits, as files for the web do.

    16 `bits` are half precision; values beyond ±65,504 become its largest number. 1 to 8 bits are 2^bits equally spaced
    levels between a column's extremes, so one extreme value coarsens all others.
    `attributes` are ``colour``, ``base_colour``, ``opacity``, ``scale``, ``rotation`` and ``position``, separated by
    commas.

    Source: published tests of watermarks; the default attributes are ours, as formats keep 16 bits and more for
    positions.
    """
    require("quantize", "bits", bits, "1 to 8, or 16", fits=bits in {*range(1, 9), HALF})
    names = select_columns("quantize", columns, attributes, ATTRIBUTES)
    if bits == HALF:
        largest = np.finfo(np.float16).max
        halves = {name: np.clip(model.table[name], -largest, largest).astype(np.float16) for name in names}
        return Attacked.changed(model, {name: column.astype(np.float32) for name, column in halves.items()})
    return Attacked.changed(model, {name: _to_levels(model.table[name], 2**bits) for name in names})


def sh_truncation(model: Gaussians, _rng: Rng, *, degree: Annotated[int, Range(0, MAX_SH_DEGREE)] = 0) -> Attacked:
    """Set the spherical harmonics above `degree` to zero; the columns stay, so that the model reads as before.

    Models without harmonics above `degree` are refused.

    Source: published tests of watermarks.
    """
    most = model.sh_degree - 1
    if degree > most:
        raise NotApplicable("sh_truncation", f"no harmonics above degree {degree}")
    rest = model.columns_named("f_rest_")
    per_channel = len(rest) // 3  # channel-major: number i holds coefficient 1 + i % per_channel
    above = [name for i, name in enumerate(rest) if 1 + i % per_channel >= (degree + 1) ** 2]
    return Attacked.changed(model, dict.fromkeys(above, np.zeros(len(model), np.float32)))


def sh_edit(model: Gaussians, rng: Rng, *, sigma: Amount = EDITED, factor: Amount = 1.0) -> Attacked:
    """Multiply the harmonics above degree 0 by `factor`, and add Gaussian noise of deviation `sigma` to each.

    `sigma` is in stored units. Only view-dependent colour changes. Models without it are refused.

    Source: ours.
    """
    names = model.columns_named("f_rest_")
    if not names:
        raise NotApplicable("sh_edit", "no harmonics above degree 0")
    noise = sigma * rng.standard_normal((len(names), len(model)))
    edited = {name: factor * model.table[name] + change for name, change in zip(names, noise, strict=True)}
    return Attacked.changed(model, edited)


def _to_levels(values: Float32, levels: int) -> Float32:
    """Return the nearest of `levels` equally spaced numbers between the finite extremes of `values`."""
    finite = values[np.isfinite(values)]
    if not len(finite) or finite.min() == finite.max():
        return values
    least = float(finite.min())
    greatest = float(finite.max())
    step = (greatest - least) / (levels - 1)
    rounded: Float32 = (least + step * np.rint((values.astype(np.float64) - least) / step)).astype(np.float32)
    return rounded


ATTACKS = named(
    {
        gaussian_noise: Strength("sigma", 1e-3, 10.0, "log"),
        opacity_noise: Strength("sigma", 1e-2, 10.0, "log"),
        position_noise: Strength("sigma", 1e-5, 0.1, "log"),
        feature_scaling: Strength("factor", 1.01, 10.0, "log"),
        quantize: Strength("bits", 8, 1),
        sh_truncation: None,
        sh_edit: Strength("sigma", 1e-3, 10.0, "log"),
    }
)
