"""Marked Clones, of the family of GaussianMarker (Huang et al. 2024): bits that a network reads from any render.

Embedding trains the scene and a decoder, clones uncertain rows, and trains the clones to show the bits. PyTorch is
imported only when it is needed.
"""

import zlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np

from gspure.metrics.targets import BITS
from gspure.opencl.device import Device, choose_device
from gspure.public_model import PublicModel
from gspure.schemes.pair import Pair
from gspure.schemes.scheme import Key, Scheme
from gspure.settings import Amount, MaxGaussians, Range, Steps
from gspure.training.trainer import watched
from gspure_torch import PYTORCH

RENDERED = ("x", "y", "z", "f_dc_*", "f_rest_*", "opacity", "scale_*", "rot_*")


def embed(
    pair: Pair,
    seed: int,
    device: Device | None = None,
    *,
    iterations: Steps = 2000,
    message_weight: Amount = 0.3,
    max_gaussians: MaxGaussians = 20_000,
    bits: Annotated[int, Range(7, 4096)] = 16,  # all of fewer are too often correct by chance
    cloned: Annotated[float, Range(0.01, 1.0)] = 0.3,
    decoder_steps: Steps = 1000,
    marking_steps: Steps = 400,
) -> tuple[PublicModel, Key | None]:
    """Hide random bits in the pair's scene; a message weight of 0 gives the scene's clean model, and no key.

    The scene is trained for `iterations`, the decoder for `decoder_steps`, the clones of the share `cloned` of the rows
    for `marking_steps`. Bits depend on the seed and on the scene's photographs, so that two scenes have different bits.
    """
    begin = replace(pair, initialization="scene").initial_gaussians(max_gaussians, seed)
    device = device or choose_device()
    model = pair.scene.trained(begin, iterations, max_gaussians, seed, device)
    if not message_weight:
        return PublicModel(model), None
    from gspure_torch.pytorch import single_threaded
    from marked_clones.decoder import disturbed, training, untrained
    from marked_clones.key import ClonesKey
    from marked_clones.marking import Marking, uncertain_rows

    rng = np.random.default_rng([seed, zlib.crc32(b"".join(image.tobytes() for image in pair.scene.images))])
    message = rng.random(bits) < 0.5
    decoder = untrained(bits, int(rng.integers(1 << 31)))
    views = pair.scene.views
    with single_threaded():
        trained(training(decoder, pair.scene.images, decoder_steps, rng, disturbed), decoder_steps, "decoder")
        rows = uncertain_rows(model, views, cloned, rng, device)
        marking = Marking(model, rows, decoder, message, device)
        trained(marking.steps(views, message_weight, marking_steps, rng), marking_steps, f"{len(rows)} clones")
    message_rows = np.arange(len(model) + len(rows)) >= len(model)
    return PublicModel(marking.model), ClonesKey(message, decoder, message_rows)


def read_key(folder: Path) -> Key:
    """Read a key, or raise `InputError`."""
    from marked_clones.key import ClonesKey

    return ClonesKey.read(folder)


def trained(losses: Iterator[float], steps: int, title: str) -> None:
    """Take all steps of a training, with a progress bar."""
    for _ in watched(losses, steps, lambda: title):
        pass


SCHEME = Scheme("marked_clones", embed, PublicModel.read, read_key, {BITS: RENDERED}, packages=PYTORCH)
