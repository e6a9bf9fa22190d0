"""The attack on the symmetries of a public file: other numbers, the same images."""

from dataclasses import replace
from typing import Annotated, Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Indices
from gspure.attacks.attack import Rng, named
from gspure.attacks.attacked import Attacked
from gspure.model.frames import TURNS, frame_columns, turned
from gspure.model.gaussians import Gaussians
from gspure.public_model import PublicModel
from gspure.settings import Range

EXPONENTS: Final = (-5, 5)  # norms of quaternions become 2^e and more, below 2^(e + 1): exact in float32; ours


def gauge(model: Gaussians, rng: Rng, public: PublicModel, *, mix: Annotated[int, Range(0, 1)] = 1) -> Attacked:
    """Draw again what no image depends on: the order of rows, frames, and with `mix` = 1 the basis of features.

    - Frames: each Gaussian's axes are permuted and reversed (24 turns), and its scales permuted with them; its
      quaternion gets a random sign, and a norm between 2⁻⁵ and 2⁶ (`gspure.model.frames`).
    - Order: rows with the same centre keep theirs, on which images depend.
    - Features are mixed, and the first layer of the public network, in the file beside the .ply, undoes the mix
      (`PublicModel.mixed`). Anchor features are rotated by a random orthogonal matrix. GS-Hider's are replaced by
      weighted means, which stay between 0 and 1 as a sigmoid requires. `mix` = 0 keeps features and networks.

    Source: ours.
    """
    mixed = public.mixed(rng) if mix else public
    rows = _order(model, rng)
    frames = _frames(model[rows], rng) if public.columns.get("rotation") else {}
    attacked = Attacked.copied(mixed.model, rows, frames)
    return replace(attacked, networks=mixed)


def _order(model: Gaussians, rng: Rng) -> Indices:
    """Return a random order of the rows [K] that keeps that of rows with the same centre, which images depend on."""
    _, inverse = np.unique(model.means, axis=0, return_inverse=True)
    places = inverse.reshape(-1)  # its shape depends on numpy's version
    order = rng.permutation(len(model))
    order[np.argsort(places[order], kind="stable")] = np.argsort(places, kind="stable")
    return order


def _frames(model: Gaussians, rng: Rng) -> dict[str, NDArray[Any]]:
    """Return the columns of scales and rotations in random frames; scales without a meaning stay in place."""
    turns = rng.integers(len(TURNS), size=len(model))
    turns[~(model.log_scales < np.inf).all(axis=1)] = 0
    quats, scales = turned(model.quats, model.log_scales, turns)
    _, exponents = np.frexp(np.linalg.norm(quats, axis=1))
    wanted = rng.integers(EXPONENTS[0], EXPONENTS[1] + 1, size=len(model))
    signs = rng.choice([-1.0, 1.0], len(model))
    quats = np.ldexp(quats * signs[:, None], (wanted + 1 - exponents)[:, None]).astype(np.float32)
    return frame_columns(quats, scales)


ATTACKS = named({gauge: None})
