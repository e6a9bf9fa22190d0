"""Splats in Splats: a hidden scene in the low bits and the opacities of a vanilla model (arXiv 2412.03121).

Embedding trains both scenes, maps the opacities, hides the colours and publishes. The paper leaves some choices open.
Ours: the loss is L(scene) + message_weight L(message), both as in 3DGS; means, quaternions and scales are shared; after
the opacity mapping is fitted, the hidden colours are trained further with the mapped opacities, which extraction uses
instead of the trained ones.
"""

from dataclasses import replace
from functools import partial
from typing import Annotated

import numpy as np

from gspure.metrics.targets import ADAPTIVE, MESSAGE
from gspure.opencl.device import Device, choose_device
from gspure.public_model import PublicModel
from gspure.schemes.carriers import permuted
from gspure.schemes.pair import Pair
from gspure.schemes.scheme import Run, Scheme
from gspure.schemes.splats_in_splats import bits
from gspure.schemes.splats_in_splats.key import SplatsInSplatsKey
from gspure.schemes.splats_in_splats.training import Training
from gspure.settings import SCHEDULES, Amount, MaxGaussians, Range, Steps
from gspure.training.trainer import watched


def embed(
    pair: Pair,
    seed: int,
    device: Device | None = None,
    *,
    iterations: Steps = 3000,
    message_weight: Amount = 1.0,
    max_gaussians: MaxGaussians = 30_000,
    shift: Annotated[int, Range(*bits.SHIFT_RANGE)] = bits.SHIFT,
    hardened: Amount = 0.0,
    schedule: str = SCHEDULES[0],
) -> tuple[PublicModel, SplatsInSplatsKey | None]:
    """Hide the pair's message in its scene; a message weight of 0 gives the scene's clean model, and no key.

    The joint training takes `iterations` steps. `message_weight` is the weight of the message's loss (the scene's is
    1). `shift` is k of `gspure.schemes.splats_in_splats.bits`. `hardened` keeps the message off the rows that
    ``plain_weight`` removes with this tau; 0 trains as in the paper, as does the vanilla `schedule`.
    """
    begin = pair.initial_gaussians(max_gaussians, seed)
    device = device or choose_device()
    if not message_weight:
        clean = pair.scene.trained(begin, iterations, max_gaussians, seed, device, schedule)
        return PublicModel(clean), None
    run = Training(Run(pair, iterations, message_weight, max_gaussians, seed, device, hardened, schedule), begin)
    for _ in watched(run, iterations, lambda: f"{run.model.models[0].count} Gaussians"):
        pass
    return run.published(shift)


GEOMETRY = ("x", "y", "z", "scale_*", "rot_*")
READS = {MESSAGE: (*GEOMETRY, "f_dc_*", "f_rest_*", "opacity"), ADAPTIVE: GEOMETRY}

CARRIERS = ("f_dc_*", "f_rest_*", "opacity")  # of colours, the low bits


def redrawn(public: PublicModel, rng: np.random.Generator) -> PublicModel:
    """Return the model with random bits in place of the hidden colours, and opacities exchanged among rows."""
    model = permuted(public, ("opacity",), rng).model
    return public.with_model(model.with_appearance(model.table["opacity"], bits.redrawn(model.sh_coeffs, rng)))


SCHEME = Scheme(
    "splats_in_splats",
    embed,
    PublicModel.read,
    SplatsInSplatsKey.read,
    READS,
    carriers=CARRIERS,
    redraw=redrawn,
)

HARDENED = replace(SCHEME, name="splats_in_splats_hardened", embed=partial(embed, hardened=2.0))
