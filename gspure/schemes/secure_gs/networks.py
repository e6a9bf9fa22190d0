"""The networks of SecureGS: perceptrons with one hidden layer, their state dicts and files.

A file holds ``NETWORK.PARAMETER``, such as ``opacity.0.weight``, of each network.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from gspure.errors import InputError
from gspure.files import Float32, Kind, load_arrays, save_arrays

Network = Mapping[str, Any]
"""State dict ``0.weight [H,I]``, ``0.bias [H]``, ``2.weight [O,H]``, ``2.bias [O]``: W_2 relu(W_0 x + b_0) + b_2."""

Networks = Mapping[str, Network]
"""By name: ``opacity``, ``cov``, ``color``; in a hidden branch also ``offset``."""

PARAMETERS: Final = ("0.weight", "0.bias", "2.weight", "2.bias")
DIRECTION: Final = 3  # inputs besides the feature: the direction from the camera; of `offset`, also the distance
OUTPUTS: Final = {"offset": 3, "opacity": 1, "cov": 7, "color": 3}  # `cov`: scale factors and quaternion
PUBLIC: Final = ("opacity", "cov", "color")
PRIVATE: Final = ("offset", *PUBLIC)


def perceptron(xp: Any, network: Network, inputs: Any) -> Any:
    """Return the outputs [V,O] of `inputs` [V,I]; `xp` is the library of both, numpy or torch."""
    first, second = ((network[f"{layer}.weight"].T, network[f"{layer}.bias"]) for layer in (0, 2))
    if xp is np:
        return (inputs @ first[0] + first[1]).clip(0) @ second[0] + second[1]
    # The same, with fewer steps and without the gradient of clip, which is many times slower than that of relu.
    return xp.addmm(second[1], xp.addmm(first[1], inputs, first[0]).relu(), second[0])


def fresh(names: tuple[str, ...], feat_dim: int, k: int, rng: np.random.Generator) -> dict[str, dict[str, Float32]]:
    """Return untrained networks with PyTorch's default initialization; only offsets read the distance (SecureGS)."""
    networks = {}
    for name in names:
        shapes = _shapes(name, feat_dim, k)
        bounds = [shapes[layer][1] ** -0.5 for layer in (0, 0, 2, 2)]
        drawn = [rng.uniform(-bound, bound, shape) for bound, shape in zip(bounds, shapes, strict=True)]
        networks[name] = {p: array.astype(np.float32) for p, array in zip(PARAMETERS, drawn, strict=True)}
    return networks


def _shapes(name: str, feat_dim: int, k: int) -> tuple[tuple[int, ...], ...]:
    inputs, outputs = feat_dim + DIRECTION + (name == "offset"), OUTPUTS[name] * k
    return (feat_dim, inputs), (feat_dim,), (outputs, feat_dim), (outputs,)


def sizes_of(networks: Networks) -> tuple[int, int]:
    """Return the length of the features, which is also the width of the hidden layer, and the Gaussians per anchor."""
    return int(networks["opacity"]["0.bias"].size), int(networks["opacity"]["2.bias"].size)


def require_sizes(source: str | Path, networks: Networks, feat_dim: int, k: int, hint: str | None = None) -> None:
    """Refuse networks that do not fit anchors of `feat_dim` features and `k` Gaussians."""
    if sizes_of(networks) != (feat_dim, k):
        found, expected = (
            "{} features and {} Gaussians per anchor".format(*n) for n in (sizes_of(networks), (feat_dim, k))
        )
        raise InputError(source, "networks", expected=expected, found=found, hint=hint)


def read_networks(file: Path, names: tuple[str, ...], content: str) -> Networks:
    """Read networks, or raise `InputError` if they do not fit one another."""
    axes = {parameter: (None,) * (1 + parameter.endswith("weight")) for parameter in PARAMETERS}
    kinds: dict[str, Kind] = {f"{name}.{p}": (np.float32, axes[p]) for name in names for p in PARAMETERS}
    arrays = load_arrays(file, kinds, content)
    networks = {name: {p: arrays[f"{name}.{p}"] for p in PARAMETERS} for name in names}
    for name, network in networks.items():
        expected, shapes = _shapes(name, *sizes_of(networks)), tuple(array.shape for array in network.values())
        if shapes != expected:
            raise InputError(file, name, expected=f"weights and biases {expected}", found=str(shapes))
    return networks


def write_networks(file: Path, networks: Networks) -> None:
    """Write networks; the same ones give the same bytes."""
    save_arrays(file, {f"{name}.{p}": array for name, network in networks.items() for p, array in network.items()})
