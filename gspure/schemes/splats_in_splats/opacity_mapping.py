r"""The opacity mapping: a small autoencoder from public to hidden opacities (arXiv 2412.03121).

.. math:: W^* = \arg\min_W \| D(E(1 - \alpha_I)) - \alpha'_I \|^2

over the Gaussians I of the message. In the paper, encoder and decoder are simple convolutions. Sizes and training are
ours: two convolutions of stride 2 along the sequence of Gaussians, whose order follows a space-filling curve, and two
transposed ones. Written in numpy, since the default scheme does not need PyTorch and gives the same bits on every run:
with one thread, since OpenBLAS adds the rows of a long product in another order with several.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from gspure.constants import ADAM_BETA1, ADAM_BETA2
from gspure.files import Float32

Weights = tuple[Float32, ...]

WIDTHS: Final = (1, 16, 32)
TAPS: Final = 5
STRIDE: Final = 2
STEPS: Final = 600
STRETCH: Final = 2048
RATE: Final = 3e-3
_EPSILON: Final = 1e-8
_UNIT: Final = STRIDE ** (len(WIDTHS) - 1)


@dataclass(frozen=True, eq=False)
class OpacityMapping:
    """Weights of the four layers, encoder first: kernels [taps * in, out] and biases [out]."""

    kernels: Weights
    biases: Weights

    @classmethod
    def fresh(cls, rng: np.random.Generator) -> OpacityMapping:
        """Return untrained layers (He et al. 2015)."""
        channels = [*pairwise(WIDTHS), *pairwise(WIDTHS[::-1])]
        kernels = [rng.normal(0, np.sqrt(2 / (TAPS * a)), (TAPS * a, b)).astype(np.float32) for a, b in channels]
        return cls(tuple(kernels), tuple(np.zeros(b, np.float32) for _, b in channels))

    @classmethod
    def of(cls, arrays: Mapping[str, Float32]) -> OpacityMapping:
        """Return the mapping with these weights, the inverse of `arrays`."""
        kernels, biases = ([a for n, a in sorted(arrays.items()) if n.startswith(kind)] for kind in ("kernel", "bias"))
        return cls(tuple(kernels), tuple(biases))

    def arrays(self) -> dict[str, Float32]:
        """Return all weights by name."""
        named = {f"kernel_{i}": kernel for i, kernel in enumerate(self.kernels)}
        return named | {f"bias_{i}": bias for i, bias in enumerate(self.biases)}

    def __call__(self, opacities: Float32) -> Float32:
        """Return the hidden opacities [N] of a sequence of public ones [N]."""
        if not len(opacities):
            return opacities
        with threadpool_limits(1, "blas"):
            return _forward(self, opacities)[-1][: len(opacities), 0]


def fit(opacities: Float32, hidden: Float32, rng: np.random.Generator) -> OpacityMapping:
    """Train a mapping from public opacities [N] to hidden ones [N], on a random stretch of the sequence per step."""
    mapping = OpacityMapping.fresh(rng)
    if not len(opacities):
        return mapping
    parameters = [array.copy() for array in (*mapping.kernels, *mapping.biases)]
    first, second = ([np.zeros_like(array) for array in parameters] for _ in range(2))
    layers = len(mapping.kernels)
    with threadpool_limits(1, "blas"):
        for step in range(1, STEPS + 1):
            mapping = OpacityMapping(tuple(parameters[:layers]), tuple(parameters[layers:]))
            rate = np.float32(RATE * 0.5 * (1 + np.cos(np.pi * step / STEPS)))  # cosine decay
            start = _UNIT * int(rng.integers(max(len(opacities) - STRETCH, 0) // _UNIT + 1))
            stretch = slice(start, start + STRETCH)
            for i, gradient in enumerate(_gradients(mapping, opacities[stretch], hidden[stretch])):
                first[i] = ADAM_BETA1 * first[i] + (1 - ADAM_BETA1) * gradient
                second[i] = ADAM_BETA2 * second[i] + (1 - ADAM_BETA2) * gradient**2
                unbiased = second[i] / np.float32(1 - ADAM_BETA2**step)
                parameters[i] -= rate * first[i] / np.float32(1 - ADAM_BETA1**step) / (np.sqrt(unbiased) + _EPSILON)
    return OpacityMapping(tuple(parameters[:layers]), tuple(parameters[layers:]))


def _forward(mapping: OpacityMapping, opacities: Float32) -> list[Float32]:
    """Return the input [L,1] and the output of each layer, the last one [L,1]; L is N rounded up to whole strides."""
    filled = np.zeros(-(-len(opacities) // _UNIT) * _UNIT, np.float32)
    filled[: len(opacities)] = opacities
    values = [1 - filled[:, None]]
    half = len(mapping.kernels) // 2
    for i, (kernel, bias) in enumerate(zip(mapping.kernels, mapping.biases, strict=True)):
        layer = _windows(values[-1], STRIDE) if i < half else _windows(_spread(values[-1]), 1)
        value = layer @ kernel + bias
        last = i == len(mapping.kernels) - 1
        values.append(1 / (1 + np.exp(-value)) if last else np.maximum(value, 0))
    return values


def _gradients(mapping: OpacityMapping, opacities: Float32, hidden: Float32) -> list[Float32]:
    """Return the gradients of the mean squared error: of the kernels, then of the biases."""
    values = _forward(mapping, opacities)
    output = values[-1]
    gradient = np.zeros_like(output)
    gradient[: len(hidden), 0] = 2 * (output[: len(hidden), 0] - hidden) / len(hidden)
    gradient *= output * (1 - output)
    half = len(mapping.kernels) // 2
    kernels: list[Float32] = []
    biases: list[Float32] = []
    for i in reversed(range(len(mapping.kernels))):
        encodes = i < half
        source = values[i] if encodes else _spread(values[i])
        kernels.insert(0, _windows(source, STRIDE if encodes else 1).T @ gradient)
        biases.insert(0, gradient.sum(axis=0))
        if i:
            back = _unwindowed(gradient @ mapping.kernels[i].T, len(source), STRIDE if encodes else 1)
            gradient = (back if encodes else back[::STRIDE]) * (values[i] > 0)
    return [*kernels, *biases]


def _windows(sequence: Float32, stride: int) -> Float32:
    """Return the `TAPS` neighbours [L / stride, TAPS * C] of every `stride`-th element of [L,C]; zero padding."""
    padded = np.pad(sequence, ((TAPS // 2, TAPS // 2), (0, 0)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, TAPS, axis=0)[::stride]
    return np.ascontiguousarray(windows.transpose(0, 2, 1)).reshape(len(windows), -1)


def _unwindowed(gradient: Float32, length: int, stride: int) -> Float32:
    """Return the gradient of a sequence [L,C], given that of its windows [L / stride, TAPS * C]."""
    padded = np.zeros((length + TAPS - 1, gradient.shape[1] // TAPS), gradient.dtype)
    for tap, part in enumerate(np.split(gradient, TAPS, axis=1)):
        padded[tap : tap + stride * len(part) : stride] += part
    return padded[TAPS // 2 : TAPS // 2 + length]


def _spread(sequence: Float32) -> Float32:
    """Return [2 L,C], the elements of [L,C] with zeros between them: the input of a transposed convolution."""
    spread = np.zeros((STRIDE * len(sequence), sequence.shape[1]), sequence.dtype)
    spread[::STRIDE] = sequence
    return spread
