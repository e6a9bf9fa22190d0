"""Planting: the Gaussians of a second scene stand in the public model with next to no opacity.

This is a fixture with known ground truth, not a published scheme: nothing is trained, and the Gaussians of both scenes
tile the surfaces of a ray-traced pair. What makes real models hard to purify is imitated: scene Gaussians that
contribute little (`gspure.scenes.population`), rows of the message that still touch pixels, and Gaussians that serve
scene and message at once where their surfaces coincide.
"""

from dataclasses import replace
from typing import Annotated

import numpy as np

from gspure.constants import SH_DC
from gspure.errors import InputError
from gspure.files import Float64, Indices
from gspure.model import Gaussians
from gspure.model.activations import logit
from gspure.opencl.device import Device
from gspure.public_model import PublicModel
from gspure.scenes.population import SOLID, log_even, populate
from gspure.scenes.surfels import Surfels, tile
from gspure.schemes.pair import Pair
from gspure.schemes.planted.key import PlantedKey
from gspure.settings import Range

MESSAGE_SHARE = 0.42  # share of all Gaussians that is spread over the message's surfaces
HIDDEN = (0.002, 0.02)  # range of the public opacity of Gaussians that serve the message only, even in the logarithm
REST_SIGMA = 0.004  # standard deviation of the higher spherical-harmonic coefficients

LEAST_GAUSSIANS = 100


def embed(
    pair: Pair,
    seed: int,
    device: Device | None = None,  # noqa: ARG001
    *,
    message_weight: Annotated[int, Range(0, 1)] = 1,
    gaussians: Annotated[int, Range(LEAST_GAUSSIANS, 10_000_000)] = 24_000,
) -> tuple[PublicModel, PlantedKey | None]:
    """Plant the pair's message in its scene; a message weight of 0 instead of 1 gives the clean model, and no key.

    `gaussians` are those of scene and message together; fewer come out where some serve both. Raise `InputError` if
    the pair is not a ray-traced one.
    """
    if pair.staging is None:
        raise InputError("scheme planted", "pair", expected="a ray-traced pair", found="no record of its scenes")
    rng = np.random.default_rng(seed)
    message_count = round(MESSAGE_SHARE * gaussians)
    shown, opacities = populate(pair.staging.lit_scene(), gaussians - message_count, rng)
    if not message_weight:
        clean = _gaussians(shown, opacities, rng)
        return PublicModel(Gaussians(clean.table[rng.permutation(len(clean))])), None
    hidden = tile(pair.staging.lit_message(), message_count, rng).moved(pair.staging.message_transform)
    public, rows = _mixed(shown, opacities, hidden, rng)
    return PublicModel(public), _key(public, rows, rng.uniform(*SOLID, message_count), hidden.colours)


def _mixed(shown: Surfels, opacities: Float64, hidden: Surfels, rng: np.random.Generator) -> tuple[Gaussians, Indices]:
    """Return the public model, in random order, and the row [M] in it that carries each hidden surfel."""
    serves = _serves(shown, hidden)
    separate = np.flatnonzero(serves < 0)
    # only opacity distinguishes the message's rows: they have the scene's colours
    disguised = replace(hidden[separate], colours=shown.colours[rng.integers(len(shown), size=len(separate))])
    surfels = Surfels.joined(shown, disguised)
    model = _gaussians(surfels, np.concatenate([opacities, log_even(HIDDEN, len(separate), rng)]), rng)
    serves[separate] = len(shown) + np.arange(len(separate))
    order = rng.permutation(len(model))
    public = Gaussians(model.table[order]).with_comment("planted message: a fixture with known ground truth")
    return public, np.argsort(order)[serves]


def _serves(shown: Surfels, hidden: Surfels) -> Indices:
    """Return for each hidden surfel [M] the shown one that can replace it, or -1.

    It is within a standard deviation, parallel, of similar size, and replaces no other.
    """
    from scipy.spatial import KDTree

    distances, nearest = KDTree(shown.means).query(hidden.means)
    sizes, shown_sizes = (np.sqrt(part.scales[:, 0] * part.scales[:, 1]) for part in (hidden, shown[nearest]))
    parallel = np.abs(np.einsum("ij,ij->i", shown.frames[nearest, 2], hidden.frames[:, 2])) > 0.99
    fits = np.flatnonzero(parallel & (distances < sizes) & (sizes < 2.0 * shown_sizes) & (shown_sizes < 2.0 * sizes))
    served, first = np.unique(nearest[fits], return_index=True)
    out = np.full(len(hidden), -1, np.intp)
    out[fits[first]] = served
    return out


def _gaussians(surfels: Surfels, opacities: Float64, rng: np.random.Generator) -> Gaussians:
    """Return surfels as a vanilla model of degree 3."""
    from scipy.spatial.transform import Rotation

    coefficients = rng.normal(0.0, REST_SIGMA, (len(surfels), 16, 3))
    coefficients[:, 0] = _dc(surfels.colours)
    return Gaussians.from_parameters(
        means=surfels.means,
        quats=Rotation.from_matrix(surfels.frames.transpose(0, 2, 1)).as_quat()[:, [3, 0, 1, 2]],
        scales=surfels.scales,
        opacities=opacities,
        sh_coeffs=coefficients,
    )


def _key(public: Gaussians, rows: Indices, opacities: Float64, colours: Float64) -> PlantedKey:
    order = np.argsort(rows)
    message_rows = np.zeros(len(public), np.bool_)
    message_rows[rows] = True
    return PlantedKey(
        message_rows, public.means, opacity=logit(opacities[order]), f_dc=_dc(colours[order]).astype(np.float32)
    )


def _dc(colours: Float64) -> Float64:
    return (colours - 0.5) / SH_DC
