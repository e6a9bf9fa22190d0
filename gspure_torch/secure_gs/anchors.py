"""Anchors, the rows of a Scaffold-GS file, networks, and the Gaussians that these compute from the visible anchors.

The formulas (Scaffold-GS, ``generate_neural_gaussians``) serve rendering and measuring with numpy and training with
torch (`xp` is the library). In a hidden branch, a network computes the offsets too (SecureGS, Eq. 4).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, Indices
from gspure.cameras.camera import Camera
from gspure.constants import EWA_DILATION, EWA_FRUSTUM_MARGIN, NEAR_PLANE, SH_DC, TILE
from gspure.errors import InputError
from gspure.model import Gaussians
from gspure.model.finite import non_finite_rows
from gspure.model.gaussians import NORMALS, ROTATION
from gspure.model.rotations import rotation_matrices
from gspure.public_model import Rows

Network = Mapping[str, Any]
"""State dict ``0.weight [H,I]``, ``0.bias [H]``, ``2.weight [O,H]``, ``2.bias [O]``: W_2 relu(W_0 x + b_0) + b_2."""

Networks = Mapping[str, Network]
"""By name: ``opacity``, ``cov``, ``color``; in a hidden branch also ``offset``."""

PARAMETERS: Final = ("0.weight", "0.bias", "2.weight", "2.bias")
DIRECTION: Final = 3  # inputs of all networks besides the feature: the direction from the camera
DISTANCE: Final = 1  # a further input of the network `offset`: the distance from the camera
OUTPUTS: Final = {"offset": 3, "opacity": 1, "cov": 7, "color": 3}  # `cov`: scale factors and quaternion
PUBLIC: Final = ("opacity", "cov", "color")
PRIVATE: Final = ("offset", *PUBLIC)

STORED_OPACITY: Final = np.float32(-2.1972246)  # logit(0.1): Scaffold-GS does not train the opacities that it stores
LARGEST_OPACITY: Final = np.float32(1 - 2**-20)  # in tables: logits are finite; rendering clips alpha at 0.99
SCALINGS: Final = 6


@dataclass(frozen=True, eq=False)
class Anchors:
    """M anchors of k Gaussians each, in arrays of numpy or torch."""

    positions: Any  # [M,3], world units; training does not move them
    offsets: Any  # [M,k,3] of the Gaussians, in multiples of the first three scalings
    features: Any  # [M,F], input of the networks
    log_scalings: Any  # [M,6], of the unit of the offsets (3), and of the scales before the network's factor (3)

    @property
    def k(self) -> int:
        """Gaussians per anchor."""
        return int(self.offsets.shape[1])

    @property
    def feat_dim(self) -> int:
        """Length of a feature."""
        return int(self.features.shape[1])

    def at(self, rows: Any) -> Anchors:
        """Return some of the anchors."""
        return Anchors(*(take_rows(part, rows) for part in vars(self).values()))

    @classmethod
    def from_table(cls, table: Gaussians) -> Anchors:
        """Return a table's anchors; column c k + i of ``f_offset_*`` is coordinate c of Gaussian i."""
        by_coordinate = table.columns(*table.columns_named("f_offset_"))
        features = table.columns(*table.columns_named("f_anchor_feat_"))
        log_scalings = table.columns(*table.columns_named("scale_"))
        k = by_coordinate.shape[1] // 3
        offsets = np.ascontiguousarray(by_coordinate.reshape(len(table), 3, k).transpose(0, 2, 1))
        return cls(table.means, offsets, features, log_scalings)

    @property
    def table(self) -> Gaussians:
        """The anchors, in arrays, as a table with the columns of Scaffold-GS, in its order."""
        offsets = self.offsets.transpose(0, 2, 1).reshape(len(self.positions), -1)
        columns: dict[str, Any] = dict(zip("xyz", self.positions.T, strict=True))
        columns |= dict.fromkeys(NORMALS, 0)
        columns |= {f"f_offset_{i}": column for i, column in enumerate(offsets.T)}
        columns |= {f"f_anchor_feat_{i}": column for i, column in enumerate(self.features.T)}
        columns["opacity"] = STORED_OPACITY
        columns |= {f"scale_{i}": column for i, column in enumerate(self.log_scalings.T)}
        columns |= {f"rot_{i}": float(i == 0) for i in range(4)}
        table = np.empty(len(self.positions), [(name, "<f4") for name in columns])
        for name, column in columns.items():
            table[name] = column
        return Gaussians(table)


def take_rows(array: Any, rows: Any) -> Any:
    """Return ``array[rows]``; PyTorch's indexing is slower than its selection, forward and backward."""
    return array[rows] if isinstance(array, np.ndarray) else array.index_select(0, rows)


def require_anchors(source: Path, table: Gaussians, feat_dim: int, k: int) -> None:
    """Refuse a table whose columns do not fit networks of these sizes, or with numbers that are not finite."""
    geometry = ["x", "y", "z", *ROTATION]
    for prefix, count in (("f_offset_", 3 * k), ("f_anchor_feat_", feat_dim), ("scale_", SCALINGS)):
        names = table.columns_named(prefix)
        if len(names) != count:
            expected = f"{count} properties"
            actual = f"{len(names)} properties"
            hint = "networks of another model?"
            raise InputError(source, f"{prefix}*", expected=expected, found=actual, hint=hint)
        geometry += names
    for name, rows in non_finite_rows(table, geometry).items():
        actual = f"infinity or not-a-number in {len(rows)} of {len(table)} rows, first in row {rows[0]}"
        raise InputError(source, name, expected="finite numbers", found=actual)


def perceptron(xp: Any, network: Network, inputs: Any) -> Any:
    """Return the outputs [V,O] of `inputs` [V,I]; `xp` is the library of both, numpy or torch."""
    first_weight = network["0.weight"].T
    first_bias = network["0.bias"]
    second_weight = network["2.weight"].T
    second_bias = network["2.bias"]
    if xp is np:
        return (inputs @ first_weight + first_bias).clip(0) @ second_weight + second_bias
    # The same, with fewer steps and without the gradient of clip, which is many times slower than that of relu.
    return xp.addmm(second_bias, xp.addmm(first_bias, inputs, first_weight).relu(), second_weight)


def fresh(names: tuple[str, ...], feat_dim: int, k: int, rng: np.random.Generator) -> dict[str, dict[str, Float32]]:
    """Return untrained networks with PyTorch's default initialization; only offsets read the distance (SecureGS)."""
    networks = {}
    for name in names:
        shapes = network_shapes(name, feat_dim, k)
        network: dict[str, Float32] = {}
        for parameter, shape in zip(PARAMETERS, shapes, strict=True):
            inputs = shapes[0][1] if parameter.startswith("0.") else shapes[2][1]
            bound = inputs**-0.5
            network[parameter] = rng.uniform(-bound, bound, shape).astype(np.float32)
        networks[name] = network
    return networks


def network_shapes(name: str, feat_dim: int, k: int) -> tuple[tuple[int, ...], ...]:
    """Return the shapes of a network's `PARAMETERS`."""
    inputs = feat_dim + DIRECTION
    if name == "offset":
        inputs += DISTANCE
    outputs = OUTPUTS[name] * k
    return (feat_dim, inputs), (feat_dim,), (outputs, feat_dim), (outputs,)


def sizes_of(networks: Networks) -> tuple[int, int]:
    """Return the length of the features, which is also the width of the hidden layer, and the Gaussians per anchor."""
    return int(networks["opacity"]["0.bias"].size), int(networks["opacity"]["2.bias"].size)


@dataclass(frozen=True, eq=False)
class Neural:
    """The k Gaussians of each of V anchors for one camera; A of them are active, and activated."""

    outputs: Any  # [V,k] of the opacity network, -1 to 1; Gaussians with a positive one are active
    active: Any  # [A], indices into the V k Gaussians, anchor by anchor
    means: Any  # [A,3]
    quats: Any  # [A,4]
    scales: Any  # [A,3]
    opacities: Any  # [A]
    colors: Any  # [A,3]


def neural(xp: Any, anchors: Anchors, networks: Networks, centre: Any) -> Neural:
    """Return the Gaussians of `anchors` [V] for a camera at `centre` [3]."""
    away = anchors.positions - centre
    distances = xp.sqrt((away * away).sum(axis=1))[:, None]
    views = away / distances
    near = xp.concatenate([anchors.features, views], axis=1)
    far = xp.concatenate([near, distances], axis=1)
    opacities = xp.tanh(perceptron(xp, networks["opacity"], near))
    count = opacities.shape[0] * anchors.k
    active = xp.argwhere(~(opacities.reshape(count) <= 0))[:, 0]  # with not-a-number, so that it is noticed
    owners = active // anchors.k
    offsets = perceptron(xp, networks["offset"], far) if "offset" in networks else anchors.offsets
    scalings = take_rows(xp.exp(anchors.log_scalings), owners)
    shapes = take_rows(perceptron(xp, networks["cov"], near).reshape(count, 7), active)
    quats = shapes[:, 3:]
    return Neural(
        outputs=opacities,
        active=active,
        means=take_rows(anchors.positions, owners) + take_rows(offsets.reshape(count, 3), active) * scalings[:, :3],
        quats=quats / xp.sqrt((quats * quats).sum(axis=1))[:, None],
        scales=scalings[:, 3:] * _sigmoid(xp, shapes[:, :3]),
        opacities=take_rows(opacities.reshape(count), active),
        colors=_sigmoid(xp, take_rows(perceptron(xp, networks["color"], near).reshape(count, 3), active)),
    )


def active_gaussians(gaussians: Neural, rows: Rows, k: int) -> tuple[Gaussians, Rows]:
    """Return the active Gaussians of the anchors `rows` [V], with colours of degree 0, and the anchor of each."""
    tiny = np.finfo(np.float32).tiny
    table = Gaussians.from_parameters(
        means=gaussians.means,
        quats=gaussians.quats,
        scales=np.maximum(gaussians.scales, tiny),
        opacities=np.clip(gaussians.opacities, tiny, LARGEST_OPACITY),
        sh_coeffs=((gaussians.colors - 0.5) / SH_DC)[:, None, :],
    )
    return table, rows[gaussians.active // k]


def _sigmoid(xp: Any, x: Any) -> Any:
    return (xp.tanh(x / 2) + 1) / 2  # neither overflows nor has a gradient of not-a-number


@np.errstate(invalid="ignore")
def visible_rows(camera: Camera, means: NDArray[Any], quats: NDArray[Any], scales: NDArray[Any]) -> Indices:
    """Return the rows of the Gaussians [M] whose three-sigma square on the screen overlaps a tile of the image.

    (Scaffold-GS, ``prefilter_voxel``; the bounds of the 3DGS rasterizer.) Rows with a zero quaternion or an infinite
    scale have none.
    """
    rotation = camera.viewmat[:3, :3]
    focal = np.diag(camera.K)[:2]
    principal = camera.K[:2, 2]
    centres = means @ rotation.T + camera.viewmat[:3, 3]
    rows = np.flatnonzero(centres[:, 2] > NEAR_PLANE)
    centres = centres[rows]
    axes = rotation @ rotation_matrices(quats[rows]) * np.asarray(scales, np.float64)[rows, None, :]
    size = np.array([camera.width, camera.height])
    slopes = centres[:, :2] / centres[:, 2:]
    margin = EWA_FRUSTUM_MARGIN * size / (2 * focal)
    clipped = np.clip(slopes, -principal / focal - margin, (size - principal) / focal + margin)
    # J A: the axes on the screen, J = f / z (I | -slope) of the perspective projection
    spread = (axes[:, :2] - clipped[:, :, None] * axes[:, 2:]) * (focal / centres[:, 2:])[:, :, None]
    a, b = np.square(spread).sum(axis=2).T + EWA_DILATION
    middle = (a + b) / 2
    determinant = a * b - (spread[:, 0] * spread[:, 1]).sum(axis=1) ** 2
    largest = middle + np.sqrt(np.maximum(0.1, middle**2 - determinant))
    radii = np.ceil(3 * np.sqrt(largest))[:, None]
    centres2d = slopes * focal + principal - 0.5  # the rasterizer samples at integer coordinates
    tiles = -(-size // TILE)
    first = np.clip(np.trunc((centres2d - radii) / TILE), 0, tiles)
    last = np.clip(np.trunc((centres2d + radii + TILE - 1) / TILE), 0, tiles)
    return np.asarray(rows[(last > first).all(axis=1)])
