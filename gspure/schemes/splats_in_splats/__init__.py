"""Splats in Splats: a hidden scene in the low bits and the opacities of a vanilla model (arXiv 2412.03121).

Embedding trains both scenes, maps the opacities, hides the colours and publishes. The paper leaves some choices open.
Ours: the loss is L(scene) + message_weight L(message), both as in 3DGS; means, quaternions and scales are shared; after
the opacity mapping is fitted, the hidden colours are trained further with the mapped opacities, which extraction uses
instead of the trained ones.
"""

from dataclasses import replace
from functools import partial
from typing import Annotated, Final

import numpy as np

from gspure.model.activations import LEAST_OPACITY, logit, sigmoid
from gspure.opencl.device import Device, choose_device
from gspure.opencl.storage import morton_order
from gspure.opencl.trainable import Parameters
from gspure.progress import say
from gspure.public_model import PublicModel
from gspure.schemes.pair import Pair
from gspure.schemes.scheme import ADAPTIVE, MESSAGE, Run, Scheme, initial_gaussians
from gspure.schemes.splats_in_splats import bits
from gspure.schemes.splats_in_splats.key import ORACLE, SplatsInSplatsKey
from gspure.schemes.splats_in_splats.opacity_mapping import fit
from gspure.schemes.splats_in_splats.training import TwinTrainer, refine
from gspure.settings import Amount, MaxGaussians, Range, Steps
from gspure.training.output import as_gaussians
from gspure.training.trainer import watched

OPACITY_THRESHOLD: Final = 0.25  # tau of the paper: the key holds the Gaussians whose opacity in the message is higher
REFINED: Final = 0.2  # iterations with the mapped opacities, as a share of those of the joint training; ours


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
) -> tuple[PublicModel, SplatsInSplatsKey | None]:
    """Hide the pair's message in its scene; a message weight of 0 gives the scene's clean model, and no key.

    The joint training takes `iterations` steps; `message_weight` is the share of the message's loss, that of the scene
    is 1; `shift` is k of `gspure.schemes.splats_in_splats.bits`; `hardened` keeps the message off the rows that
    ``plain_weight`` removes with this tau, 0 trains as in the paper.
    """
    begin = initial_gaussians(pair, max_gaussians, seed)
    device = device or choose_device()
    if not message_weight:
        return PublicModel(pair.scene.trained(begin, iterations, max_gaussians, seed, device)), None
    run = TwinTrainer(Run(pair, iterations, message_weight, max_gaussians, seed, device, hardened), begin)

    def state() -> str:
        return f"{pair.quality(*(model.image for model in run.model.models))}  {run.model.count} Gaussians"

    for _ in watched(run, iterations, state):
        pass
    shown, hidden = (state.parameters for state in run.model.states())
    return _published(pair, shown, hidden, shift, round(REFINED * iterations), seed, device)


def _published(
    pair: Pair, shown: Parameters, hidden: Parameters, shift: int, steps: int, seed: int, device: Device
) -> tuple[PublicModel, SplatsInSplatsKey]:
    """Return the public model and its key."""
    known = np.flatnonzero(sigmoid(hidden.opacity_logits) > OPACITY_THRESHOLD)
    known = known[morton_order(hidden.means[known])]
    opacities = sigmoid(shown.opacity_logits)[known]
    mapping = fit(opacities, sigmoid(hidden.opacity_logits)[known], np.random.default_rng(seed))
    extracted = replace(hidden.rows(known), opacity_logits=logit(mapping(opacities), LEAST_OPACITY))
    colours = hidden.sh_coeffs.copy()
    colours[known] = refine(extracted, pair.message, steps, seed, device).sh_coeffs
    public = replace(shown, sh_coeffs=bits.embed(shown.sh_coeffs, colours, shift))
    say(f"{len(known)} of {len(shown)} Gaussians have an opacity above {OPACITY_THRESHOLD} in the message")
    return PublicModel(as_gaussians(public)), SplatsInSplatsKey(
        hidden.means[known], mapping, shift, as_gaussians(hidden)
    )


GEOMETRY = ("x", "y", "z", "scale_*", "rot_*")
READS = {MESSAGE: (*GEOMETRY, "f_dc_*", "f_rest_*", "opacity"), ADAPTIVE: GEOMETRY, ORACLE: GEOMETRY}

SCHEME = Scheme("splats_in_splats", embed, PublicModel.read, SplatsInSplatsKey.read, READS)

HARDENED = replace(SCHEME, name="splats_in_splats_hardened", embed=partial(embed, hardened=2.0))
