"""The networks of Scaffold-GS: perceptrons with one hidden layer, their state dicts and files.

::

    <folder>/checkpoints.pth                                          all state dicts ("unite"); read and written
    <folder>/{opacity,cov,color}_mlp.pt [feature_bank_mlp.pt]         one TorchScript trace each ("split"); read
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from gspure.errors import InputError
from gspure.files import Float32
from gspure.progress import warn
from gspure.schemes.tensors import Tensor, read_tensors, write_tensors

Network = Mapping[str, Any]
"""State dict ``0.weight [H,I]``, ``0.bias [H]``, ``2.weight [O,H]``, ``2.bias [O]``: W_2 relu(W_0 x + b_0) + b_2."""

Networks = Mapping[str, Network]
"""By name: ``opacity``, ``cov``, ``color``, optionally ``feature_bank``; in a hidden branch also ``offset``."""

PARAMETERS: Final = ("0.weight", "0.bias", "2.weight", "2.bias")
DIRECTION: Final = 3  # inputs besides the feature: the direction from the camera; optionally, one more for the distance
OUTPUTS: Final = {"offset": 3, "opacity": 1, "cov": 7, "color": 3}  # `cov`: scale factors and quaternion

BANK: Final = "feature_bank"
BANK_INPUTS: Final = 4
BANK_LEVELS: Final = 3
BANK_STEP: Final = 4
"""A feature bank maps direction and distance to the weights of three resolutions; the coarsest is every fourth."""

_PHOTOGRAPHS: Final = "trained with an appearance embedding per photograph? train with appearance_dim 0"


def perceptron(xp: Any, network: Network, inputs: Any) -> Any:
    """Return the outputs [V,O] of `inputs` [V,I]; `xp` is the library of both, numpy or torch."""
    first, second = ((network[f"{layer}.weight"].T, network[f"{layer}.bias"]) for layer in (0, 2))
    if xp is np:
        return (inputs @ first[0] + first[1]).clip(0) @ second[0] + second[1]
    # The same, with fewer steps and without the gradient of clip, which is many times slower than that of relu.
    return xp.addmm(second[1], xp.addmm(first[1], inputs, first[0]).relu(), second[0])


def takes_distance(network: Network, feat_dim: int) -> bool:
    """Tell whether the distance from the camera is among a network's inputs."""
    return bool(network["0.weight"].shape[1] == feat_dim + DIRECTION + 1)


def fresh(names: tuple[str, ...], feat_dim: int, k: int, rng: np.random.Generator) -> dict[str, dict[str, Float32]]:
    """Return untrained networks with PyTorch's default initialization; only offsets read the distance (SecureGS)."""
    return {name: _drawn(feat_dim + DIRECTION + (name == "offset"), feat_dim, OUTPUTS[name] * k, rng) for name in names}


def _drawn(inputs: int, hidden: int, outputs: int, rng: np.random.Generator) -> dict[str, Float32]:
    """Sample weights and biases uniformly within 1 / sqrt(inputs) of 0."""
    shapes = ((hidden, inputs), (hidden,), (outputs, hidden), (outputs,))
    bounds = (inputs**-0.5, inputs**-0.5, hidden**-0.5, hidden**-0.5)
    drawn = (rng.uniform(-bound, bound, shape) for bound, shape in zip(bounds, shapes, strict=True))
    return {name: array.astype(np.float32) for name, array in zip(PARAMETERS, drawn, strict=True)}


def require_networks(source: Path, networks: Networks, feat_dim: int, k: int) -> None:
    """Refuse networks that are not finite or do not fit anchors of `feat_dim` features and `k` Gaussians."""
    for name, network in networks.items():
        bank = name == BANK
        inputs = (BANK_INPUTS,) if bank else (feat_dim + DIRECTION, feat_dim + DIRECTION + 1)
        outputs = BANK_LEVELS if bank else OUTPUTS[name] * k
        shapes = tuple(network[parameter].shape for parameter in PARAMETERS)
        hidden = network["0.bias"].size
        if shapes not in [((hidden, n), (hidden,), (outputs, hidden), (outputs,)) for n in inputs]:
            expected = f"{' or '.join(map(str, inputs))} inputs and {outputs} outputs"
            hint = _PHOTOGRAPHS if name == "color" and network["0.weight"].shape[-1:] > inputs[-1:] else None
            found = f"weights and biases {', '.join(str(list(shape)) for shape in shapes)}"
            raise InputError(source, name, expected=expected, found=found, hint=hint)
        for parameter in PARAMETERS:
            if not np.isfinite(network[parameter]).all():
                raise InputError(source, f"{name}.{parameter}", expected="finite numbers", found="others")
    if BANK in networks and feat_dim % BANK_STEP:
        expected = f"a multiple of {BANK_STEP} features"
        raise InputError(source, "feature_bank", expected=expected, found=str(feat_dim))


Loaded = dict[str, dict[str, Float32]]

PUBLIC: Final = ("opacity", "cov", "color")
PRIVATE: Final = ("offset", *PUBLIC)
UNITED: Final = "checkpoints.pth"


def read_networks(folder: Path) -> Loaded:
    """Read the public networks in a folder.

    Raise `InputError` if a file or parameter is missing, or a file holds more than tensors.
    """
    united = folder / UNITED
    if united.is_file():
        if any(folder.glob("*_mlp.pt")):
            warn(f"{folder} has {UNITED} and networks *_mlp.pt: {UNITED} is used")
        return _by_network(united, read_tensors(united))
    tensors: dict[str, Tensor] = {}
    for name in (*PUBLIC, BANK):
        file = folder / f"{name}_mlp.pt"
        if name != BANK or file.is_file():
            if not file.is_file():
                found = f"neither it nor {UNITED}"
                raise InputError(file, "file", expected="a network beside the .ply", found=found)
            tensors |= {f"{name}_mlp.{parameter}": array for parameter, array in read_tensors(file).items()}
    return _by_network(folder, tensors)


def write_networks(folder: Path, networks: Networks) -> None:
    """Write the public networks in Scaffold-GS's united format."""
    write_tensors(folder / UNITED, {f"{name}_mlp": network for name, network in networks.items()})


def _by_network(source: Path, tensors: Mapping[str, Tensor]) -> Loaded:
    names = [*PUBLIC, *([BANK] if any(name.startswith(f"{BANK}_mlp.") for name in tensors) else [])]
    for missing in {f"{name}_mlp.{parameter}" for name in names for parameter in PARAMETERS} - tensors.keys():
        raise InputError(source, missing, expected="a network's parameter", found="no such tensor")
    networks = {name: {parameter: tensors[f"{name}_mlp.{parameter}"] for parameter in PARAMETERS} for name in names}
    for name, parameter, tensor in ((n, p, tensor) for n, net in networks.items() for p, tensor in net.items()):
        if tensor.dtype != np.float32:
            raise InputError(source, f"{name}.{parameter}", expected="float32 numbers", found=str(tensor.dtype))
    return networks
