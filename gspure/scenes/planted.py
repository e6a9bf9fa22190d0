"""A public model in which a message is planted, with the truth about every Gaussian.

This is a fixture, not a watermarking scheme: no training embeds anything. The Gaussians of a second scene stand in the
public model with next to no opacity, and the owner's key holds their private opacity and colour. What makes real
models hard to purify is imitated: scene Gaussians that contribute little (`gspure.scenes.population`), carriers that
still touch pixels, and Gaussians that serve scene and message at once where their surfaces coincide.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.constants import SH_DC
from gspure.errors import InputError
from gspure.model.activations import logit
from gspure.model.gaussians import Gaussians
from gspure.scenes.camera_path import stage_cameras
from gspure.scenes.lighting import LitScene, bake
from gspure.scenes.placement import PLACEMENTS
from gspure.scenes.planted_key import PlantedKey
from gspure.scenes.population import SOLID, log_even, populate
from gspure.scenes.room import room
from gspure.scenes.surfels import Surfels, tile
from gspure.scenes.vault import vault

Float64 = NDArray[np.float64]
Value = TypeVar("Value")

STAGES = {"room": room, "vault": vault}
"""Procedural scenes by name; each may be the scene or the message."""

MESSAGE_SHARE = 0.42
"""Share of all Gaussians that is spread over the message's surfaces."""

HIDDEN = (0.002, 0.02)
"""Range of the public opacity of Gaussians that serve the message only, even in the logarithm."""

REST_SIGMA = 0.004
"""Standard deviation of the higher spherical-harmonic coefficients."""


@dataclass(frozen=True, eq=False)
class Planted:
    """A planted pair.

    Parameters
    ----------
    public : Gaussians
        What everybody gets.
    key : PlantedKey
        What the owner keeps.
    cameras : list of Camera
    carries_message : bool [K]
        The truth about each public row.
    scene, message : LitScene
        What `gspure.scenes.ray_tracer.trace` photographs.

    """

    public: Gaussians
    key: PlantedKey
    cameras: list[Camera]
    carries_message: NDArray[np.bool_]
    scene: LitScene
    message: LitScene


def plant(
    seed: int,
    *,
    scene: str = "room",
    message: str = "vault",
    placement: str = "raised",
    gaussians: int = 24_000,
    views: int = 24,
    width: int = 320,
    height: int = 240,
) -> Planted:
    """Plant a message in a scene.

    Parameters
    ----------
    seed : int
    scene, message : str
        Names in `STAGES`.
    placement : str
        Where the message's stage stands, a name in `gspure.scenes.placement.PLACEMENTS`.
    gaussians : int
        Of scene and message together; fewer come out where some serve both.
    views, width, height : int
        Number of cameras, and their size in pixels.

    Raises
    ------
    InputError
        A name is unknown.

    """
    build_scene, build_message = _named("scene", scene, STAGES), _named("message", message, STAGES)
    scene_lit = bake(build_scene(PLACEMENTS["coincident"]))
    message_lit = bake(build_message(_named("placement", placement, PLACEMENTS)))
    rng = np.random.default_rng(seed)
    message_count = round(MESSAGE_SHARE * gaussians)
    shown, opacities = populate(scene_lit, gaussians - message_count, rng)
    hidden = tile(message_lit, message_count, rng)
    public, rows = _mixed(shown, opacities, hidden, rng)
    key = _key(public, rows, rng.uniform(*SOLID, message_count), hidden.colours)
    carries = np.zeros(len(public), np.bool_)
    carries[key.rows] = True
    return Planted(public, key, stage_cameras(views, width, height), carries, scene_lit, message_lit)


def _named(field: str, name: str, known: Mapping[str, Value]) -> Value:
    if name not in known:
        raise InputError("plant", field, expected=f"one of {', '.join(known)}", found=repr(name))
    return known[name]


def _mixed(
    shown: Surfels, opacities: Float64, hidden: Surfels, rng: np.random.Generator
) -> tuple[Gaussians, NDArray[np.intp]]:
    """Return the public model, in random order, and the row [M] in it that carries each hidden surfel."""
    serves = _serves(shown, hidden)
    own = np.flatnonzero(serves < 0)
    # nothing but opacity tells carriers from others: they have the scene's colours
    disguised = replace(hidden[own], colours=shown.colours[rng.integers(len(shown), size=len(own))])
    surfels = Surfels.joined(shown, disguised)
    model = _gaussians(surfels, np.concatenate([opacities, log_even(HIDDEN, len(own), rng)]), rng)
    serves[own] = len(shown) + np.arange(len(own))
    order = rng.permutation(len(model))
    public = Gaussians(model.table[order]).with_comment("planted message: a fixture with known ground truth")
    return public, np.argsort(order)[serves]


def _serves(shown: Surfels, hidden: Surfels) -> NDArray[np.intp]:
    """Return for each hidden surfel [M] the shown one that can take its place, or -1.

    It lies within a standard deviation on a parallel surface, is about as large, and takes no other's place.
    """
    from scipy.spatial import KDTree

    distances, nearest = KDTree(shown.means).query(hidden.means)
    sizes, others = (np.sqrt(part.scales[:, 0] * part.scales[:, 1]) for part in (hidden, shown[nearest]))
    parallel = np.abs(np.einsum("ij,ij->i", shown.frames[nearest, 2], hidden.frames[:, 2])) > 0.99
    fits = np.flatnonzero(parallel & (distances < sizes) & (sizes < 2.0 * others) & (others < 2.0 * sizes))
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


def _key(public: Gaussians, rows: NDArray[np.intp], opacities: Float64, colours: Float64) -> PlantedKey:
    order = np.argsort(rows)
    rows, opacities = rows[order], opacities[order]
    return PlantedKey(
        rows=rows.astype(np.int64),
        positions=public.means[rows],
        opacity=logit(opacities),
        f_dc=_dc(colours[order]).astype(np.float32),
    )


def _dc(colours: Float64) -> Float64:
    return (colours - 0.5) / SH_DC
