"""The network: from a public Gaussian and the key to a Gaussian of the message (arXiv 2503.07191).

A perceptron with layers of 64 and 128 units reads the 59 stored numbers of a row and the 768 of the key. Linear heads,
stored as one last layer, return offsets of position, quaternion, log-scale, opacity logit and harmonics.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, Final

import numpy as np

from gspure.arrays import Float32
from gspure.constants import GEOMETRY_ATTRIBUTES
from gspure.model import Gaussians
from gspure.opencl.trainable import Parameters
from gspure.training.output import as_gaussians

Network = Mapping[str, Any]  # `weight_i` [O,I] and `bias_i` [O] of the layers
ROW: Final = GEOMETRY_ATTRIBUTES + 48  # numbers of a vanilla row of degree 3, in the order of `Parameters`
KEY: Final = 768  # length of the key; the authors' keys are embeddings of CLIP

SIZES: Final = (ROW + KEY, 64, 128, ROW)


def _shapes() -> dict[str, tuple[int, ...]]:
    shapes: dict[str, tuple[int, ...]] = {}
    for layer, (inputs, outputs) in enumerate(pairwise(SIZES)):
        shapes[f"weight_{layer}"] = (outputs, inputs)
        shapes[f"bias_{layer}"] = (outputs,)
    return shapes


SHAPES: Final = _shapes()
_LAST: Final = len(SIZES) - 2
RATE: Final = 2e-3  # initial learning rate; ours, for a few thousand iterations; the authors' is 5e-5


def fresh(rng: np.random.Generator) -> dict[str, Float32]:
    """Return layers with PyTorch's default initialization, and heads of zero: the initial message is the scene."""
    layers: dict[str, Float32] = {}
    for layer, inputs in enumerate(SIZES[:-1]):
        bound = np.float32(0.0 if layer == _LAST else inputs**-0.5)
        for name in (f"weight_{layer}", f"bias_{layer}"):
            layers[name] = rng.uniform(-1, 1, SHAPES[name]).astype(np.float32) * bound
    return layers


def random_key(rng: np.random.Generator) -> Float32:
    """Return a random unit vector [768]."""
    vector = rng.standard_normal(KEY)
    return np.asarray(vector / np.linalg.norm(vector), np.float32)


def added(network: Network, key: Float32, rows: Float32) -> Any:
    """Return the offsets [K,59] from public rows to those of the message."""
    weight = network["weight_0"]
    bias = weight[:, ROW:] @ key + network["bias_0"]  # the key is the same for all rows
    values = rows @ weight[:, :ROW].T + bias
    for layer in range(1, _LAST + 1):
        values = values.clip(0) @ network[f"weight_{layer}"].T + network[f"bias_{layer}"]
    return values


def gaussians_of(rows: Float32) -> Gaussians:
    """Return rows [K,59] as a vanilla model."""
    return as_gaussians(Parameters.split(rows[:, :GEOMETRY_ATTRIBUTES], rows[:, GEOMETRY_ATTRIBUTES:]))
