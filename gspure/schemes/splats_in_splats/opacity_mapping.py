r"""The opacity mapping: a small autoencoder from public to hidden opacities (arXiv 2412.03121).

.. math:: W^* = \arg\min_W \| D(E(1 - \alpha_I)) - \alpha'_I \|^2

over the Gaussians I of the message. In the paper, encoder and decoder are simple convolutions. Sizes and training are
ours: two convolutions of stride 2 along the sequence of Gaussians, whose order follows a space-filling curve, and two
transposed ones. Written in numpy, since the default scheme does not need PyTorch and gives the same bits on every run:
with one thread, since OpenBLAS adds the rows of a long product in another order with several.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from gspure.arrays import Float32
from gspure.constants import ADAM_BETA1, ADAM_BETA2

WIDTHS: Final = (1, 16, 32)
LAYERS: Final = 2 * (len(WIDTHS) - 1)
TAPS: Final = 5
STRIDE: Final = 2
STEPS: Final = 600
STRETCH: Final = 2048
RATE: Final = 3e-3
_EPSILON: Final = 1e-8
_UNIT: Final = STRIDE ** (len(WIDTHS) - 1)
_NAMES: Final = tuple(f"{kind}_{layer}" for kind in ("kernel", "bias") for layer in range(LAYERS))


@dataclass(frozen=True, eq=False)
class OpacityMapping:
    """The four layers, encoder first: their kernels [taps * in, out], then their biases [out]."""

    weights: tuple[Float32, ...]

    @classmethod
    def fresh(cls, rng: np.random.Generator) -> OpacityMapping:
        """Return untrained layers (He et al. 2015)."""
        kernels: list[Float32] = []
        biases: list[Float32] = []
        for inputs, outputs in [*pairwise(WIDTHS), *pairwise(WIDTHS[::-1])]:
            deviation = np.sqrt(2 / (TAPS * inputs))
            kernels.append(rng.normal(0, deviation, (TAPS * inputs, outputs)).astype(np.float32))
            biases.append(np.zeros(outputs, np.float32))
        return cls((*kernels, *biases))

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Float32]) -> OpacityMapping:
        """Return the mapping with these weights, the inverse of `arrays`."""
        return cls(tuple(arrays[name] for name in _NAMES))

    @property
    def arrays(self) -> dict[str, Float32]:
        """All weights by name."""
        return dict(zip(_NAMES, self.weights, strict=True))

    def __call__(self, opacities: Float32) -> Float32:
        """Return the hidden opacities [N] of a sequence of public ones [N]."""
        if not len(opacities):
            return opacities
        with threadpool_limits(1, "blas"):
            return _forward(self.weights, opacities)[-1][: len(opacities), 0]


def fit(opacities: Float32, hidden: Float32, rng: np.random.Generator) -> OpacityMapping:
    """Train a mapping from public opacities [N] to hidden ones [N], on a random stretch of the sequence per step."""
    weights = [*OpacityMapping.fresh(rng).weights]
    if not len(opacities):
        return OpacityMapping(tuple(weights))
    first = [np.zeros_like(array) for array in weights]
    second = [np.zeros_like(array) for array in weights]
    with threadpool_limits(1, "blas"):
        for step in range(1, STEPS + 1):
            rate = np.float32(RATE * 0.5 * (1 + np.cos(np.pi * step / STEPS)))  # cosine decay
            start = _UNIT * int(rng.integers(max(len(opacities) - STRETCH, 0) // _UNIT + 1))
            stretch = slice(start, start + STRETCH)
            for i, gradient in enumerate(_gradients(weights, opacities[stretch], hidden[stretch])):
                first[i] = ADAM_BETA1 * first[i] + (1 - ADAM_BETA1) * gradient
                second[i] = ADAM_BETA2 * second[i] + (1 - ADAM_BETA2) * gradient**2
                unbiased = second[i] / np.float32(1 - ADAM_BETA2**step)
                weights[i] -= rate * first[i] / np.float32(1 - ADAM_BETA1**step) / (np.sqrt(unbiased) + _EPSILON)
    return OpacityMapping(tuple(weights))


def _forward(weights: Sequence[Float32], opacities: Float32) -> list[Float32]:
    """Return the input [L,1] and the output of each layer, the last one [L,1]; L is N, rounded up to whole strides."""
    filled = np.zeros(-(-len(opacities) // _UNIT) * _UNIT, np.float32)
    filled[: len(opacities)] = opacities
    values = [1 - filled[:, None]]
    for i, (kernel, bias) in enumerate(zip(weights[:LAYERS], weights[LAYERS:], strict=True)):
        encodes = i < LAYERS // 2
        windows = _windows(values[-1], STRIDE) if encodes else _windows(_spread(values[-1]), 1)
        value = windows @ kernel + bias
        values.append(np.maximum(value, 0) if i < LAYERS - 1 else 1 / (1 + np.exp(-value)))
    return values


def _gradients(weights: Sequence[Float32], opacities: Float32, hidden: Float32) -> list[Float32]:
    """Return the gradients of the mean squared error: of the kernels, then of the biases."""
    values = _forward(weights, opacities)
    output = values[-1]
    gradient = np.zeros_like(output)
    gradient[: len(hidden), 0] = 2 * (output[: len(hidden), 0] - hidden) / len(hidden)
    gradient *= output * (1 - output)
    gradients: list[Float32] = []
    for i in reversed(range(LAYERS)):
        encodes = i < LAYERS // 2
        source = values[i] if encodes else _spread(values[i])
        stride = STRIDE if encodes else 1
        gradients += [gradient.sum(axis=0), _windows(source, stride).T @ gradient]
        if i:
            back = _unwindowed(gradient @ weights[i].T, len(source), stride)
            gradient = (back if encodes else back[::STRIDE]) * (values[i] > 0)
    return [*gradients[::-2], *gradients[-2::-2]]


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
