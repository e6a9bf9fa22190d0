"""Keyed pattern: bits in a pattern of signs on a world grid, added to the colours of a clean model (ours).

The reference defence. Nothing is trained but the clean model, and no network reads the mark: see
`gspure.schemes.keyed_pattern.pattern` for what is embedded, and `gspure.schemes.keyed_pattern.key` for how the owner
proves it.
"""

from dataclasses import replace
from typing import Annotated, Final

import numpy as np

from gspure.metrics.targets import MODEL_BITS
from gspure.opencl.device import Device
from gspure.public_model import PublicModel
from gspure.schemes.keyed_pattern import residuals
from gspure.schemes.keyed_pattern.key import KeyedPatternKey
from gspure.schemes.keyed_pattern.strength import strongest
from gspure.schemes.pair import Pair
from gspure.schemes.scheme import Scheme
from gspure.settings import Amount, MaxGaussians, Range, Steps

COMPARED: Final = 12  # views of the key; ours


def embed(
    pair: Pair,
    seed: int,
    device: Device | None = None,
    *,
    iterations: Steps = 3000,
    message_weight: Amount = 0.3,
    max_gaussians: MaxGaussians = 30_000,
    bits: Annotated[int, Range(7, 4096)] = 32,
) -> tuple[PublicModel, KeyedPatternKey | None]:
    """Train the pair's scene, and hide random bits in its colours; a message weight of 0 gives the clean model.

    `message_weight` is what embedding costs at most: the drop of the mean PSNR of the training views, in dB.
    """
    begin = replace(pair, initialization="scene").initial_gaussians(max_gaussians, seed)
    clean = pair.scene.trained(begin, iterations, max_gaussians, seed, device)
    if not message_weight:
        return PublicModel(clean), None
    chosen = np.linspace(0, len(pair.scene.views) - 1, min(COMPARED, len(pair.scene.views))).round().astype(int)
    views = [pair.scene.views[number] for number in chosen]
    key = KeyedPatternKey.random(np.random.default_rng([seed, 1]), bits, clean, views)
    return PublicModel(strongest(clean, key.pattern, pair.scene, message_weight, device)), key


def copied(marked: PublicModel, onto: PublicModel) -> PublicModel:
    """Return another model with the pattern of a marked one, as far as it is known without a key."""
    return onto.with_model(residuals.copied(marked.model, onto.model))


READS: Final = ("x", "y", "z", "f_*", "opacity", "scale_*", "rot_*")  # rows, and renders of them

SCHEME = Scheme("keyed_pattern", embed, PublicModel.read, KeyedPatternKey.read, {MODEL_BITS: READS}, copy=copied)
