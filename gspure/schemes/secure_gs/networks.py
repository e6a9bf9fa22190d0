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
from gspure.schemes.tensors import read_tensors

Network = Mapping[str, Any]
"""State dict ``0.weight [H,I]``, ``0.bias [H]``, ``2.weight [O,H]``, ``2.bias [O]``: W_2 relu(W_0 x + b_0) + b_2."""

Networks = Mapping[str, Network]
"""By name: ``opacity``, ``cov``, ``color``, optionally ``feature_bank``; in a hidden branch also ``offset``."""

PARAMETERS: Final = ("0.weight", "0.bias", "2.weight", "2.bias")
DIRECTION: Final = 3  # inputs besides the feature: the direction from the camera; optionally, one more for the distance
OUTPUTS: Final = {"offset": 3, "opacity": 1, "cov": 7, "color": 3}  # `cov`: scale factors and quaternion
PUBLIC: Final = ("opacity", "cov", "color")
PRIVATE: Final = ("offset", *PUBLIC)
UNITED: Final = "checkpoints.pth"

BANK: Final = "feature_bank"
"""It maps direction and distance to the weights of three resolutions of a feature; the coarsest is every fourth."""

_PHOTOGRAPHS: Final = "trained with an appearance embedding per photograph? train with appearance_dim 0"


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
        shapes = _shapes(feat_dim + DIRECTION + (name == "offset"), feat_dim, OUTPUTS[name] * k)
        bounds = [shapes[layer][1] ** -0.5 for layer in (0, 0, 2, 2)]
        drawn = [rng.uniform(-bound, bound, shape) for bound, shape in zip(bounds, shapes, strict=True)]
        networks[name] = {p: array.astype(np.float32) for p, array in zip(PARAMETERS, drawn, strict=True)}
    return networks


def _shapes(inputs: int, hidden: int, outputs: int) -> tuple[tuple[int, ...], ...]:
    return (hidden, inputs), (hidden,), (outputs, hidden), (outputs,)


def require_sizes(source: Path, networks: Networks, feat_dim: int, k: int) -> None:
    """Refuse networks that do not fit anchors of `feat_dim` features and `k` Gaussians."""
    for name, network in networks.items():
        inputs = (DIRECTION + 1,) if name == BANK else (feat_dim + DIRECTION, feat_dim + DIRECTION + 1)
        outputs = 3 if name == BANK else OUTPUTS[name] * k
        shapes = tuple(network[parameter].shape for parameter in PARAMETERS)
        if shapes not in [_shapes(n, network["0.bias"].size, outputs) for n in inputs]:
            expected = f"{' or '.join(map(str, inputs))} inputs and {outputs} outputs"
            hint = _PHOTOGRAPHS if name == "color" and shapes[0][-1:] > inputs[-1:] else None
            found = f"weights and biases {', '.join(str(list(shape)) for shape in shapes)}"
            raise InputError(source, name, expected=expected, found=found, hint=hint)
    if BANK in networks and feat_dim % 4:
        raise InputError(source, BANK, expected="a multiple of 4 features", found=str(feat_dim))


def read_networks(folder: Path) -> dict[str, dict[str, Float32]]:
    """Read the public networks in a folder, or raise `InputError`."""
    source = folder / UNITED
    if source.is_file():
        if any(folder.glob("*_mlp.pt")):
            warn(f"{folder} has {UNITED} and networks *_mlp.pt: {UNITED} is used")
        tensors = read_tensors(source)
    else:
        files = {name: folder / f"{name}_mlp.pt" for name in (*PUBLIC, BANK)}
        present = {name: read_tensors(file) for name, file in files.items() if name != BANK or file.is_file()}
        tensors = {f"{n}_mlp.{parameter}": array for n, net in present.items() for parameter, array in net.items()}
        source = folder
    names = [*PUBLIC, *([BANK] if any(name.startswith(f"{BANK}_mlp.") for name in tensors) else [])]
    for name in (f"{name}_mlp.{parameter}" for name in names for parameter in PARAMETERS):
        if name not in tensors:
            raise InputError(source, name, expected="a network's parameter", found="no such tensor")
        if tensors[name].dtype != np.float32 or not np.isfinite(tensors[name]).all():
            raise InputError(source, name, expected="finite float32 numbers", found="others")
    return {name: {parameter: tensors[f"{name}_mlp.{parameter}"] for parameter in PARAMETERS} for name in names}
