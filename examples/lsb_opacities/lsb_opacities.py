"""A mark in the file: each row holds one bit of the message in the last bit of its opacity.

A keyed hash of the row's position says which bit it holds, and whether inverted; so rows may be reordered or removed.
"""

import zlib
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np

from gspure import Plugin
from gspure.arrays import load_arrays, save_arrays
from gspure.metrics.targets import MODEL_BITS
from gspure.public_model import PublicModel
from gspure.schemes.scheme import Key, Scheme
from gspure.settings import Amount, MaxGaussians, Range, Steps

FILE = "lsb_opacities.npz"
ARRAYS = {"bits": (np.bool_, (None,)), "multipliers": (np.uint64, (3,))}


class OpacityKey(Key):
    """The message [N], and the odd multipliers [3] of the hash."""

    def __init__(self, bits, multipliers):
        self.bits = bits
        self.multipliers = multipliers

    def carried(self, model):
        """Return the index of the bit that each row holds, and whether it is inverted."""
        positions = np.ascontiguousarray(model.means).view(np.uint32).astype(np.uint64)
        hashes = (positions * self.multipliers).sum(axis=1) >> np.uint64(33)
        return (hashes // 2 % len(self.bits)).astype(np.int64), hashes % 2 == 1

    def marked(self, model):
        """Return a model with the message in its opacities."""
        indices, is_inverted = self.carried(model)
        words = model.table["opacity"].view(np.uint32)
        last_bits = self.bits[indices] ^ is_inverted
        return model.with_columns({"opacity": (words & ~np.uint32(1) | last_bits).view(np.float32)})

    def read_model_bits(self, public):
        """Return the majority of the rows of each bit."""
        indices, is_inverted = self.carried(public.model)
        words = np.ascontiguousarray(public.model.table["opacity"]).view(np.uint32)
        votes = np.where((words & 1 == 1) ^ is_inverted, 1, -1)
        return np.bincount(indices, votes, len(self.bits)) > 0

    def wrong(self, rng):
        """Return other bits and another hash."""
        return key_of(rng, len(self.bits))

    def write(self, folder):
        """Write both arrays."""
        save_arrays(folder / FILE, {"bits": self.bits, "multipliers": self.multipliers})


def key_of(rng, count):
    """Return a random key to `count` bits."""
    return OpacityKey(rng.random(count) < 0.5, rng.integers(1 << 63, size=3, dtype=np.uint64) | np.uint64(1))


def embed(
    pair,
    seed,
    device=None,
    *,
    iterations: Steps = 2000,
    message_weight: Amount = 1.0,
    max_gaussians: MaxGaussians = 20_000,
    bits: Annotated[int, Range(7, 4096)] = 32,
):
    """Train the pair's scene, and hide random bits in it; a message weight of 0 gives the clean model."""
    begin = replace(pair, initialization="scene").initial_gaussians(max_gaussians, seed)
    model = pair.scene.trained(begin, iterations, max_gaussians, seed, device)
    if not message_weight:
        return PublicModel(model), None
    photographs = b"".join(image.tobytes() for image in pair.scene.images)  # another scene has other bits
    key = key_of(np.random.default_rng([seed, zlib.crc32(photographs)]), bits)
    return PublicModel(key.marked(model)), key


def read_key(folder):
    """Read a key, or raise `InputError`."""
    return OpacityKey(**load_arrays(Path(folder) / FILE, ARRAYS, "a key of marked opacities"))


SCHEME = Scheme("lsb_opacities", embed, PublicModel.read, read_key, {MODEL_BITS: ("opacity", "x", "y", "z")})
PLUGIN = Plugin(schemes=(SCHEME,))
