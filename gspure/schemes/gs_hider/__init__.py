"""GS-Hider (Zhang et al. 2024): one feature map; a public network decodes the scene, a private one the message."""

from dataclasses import replace
from functools import partial
from typing import Annotated, Final

from gspure.opencl.device import Device, choose_device
from gspure.schemes.gs_hider.files import MESSAGE_DECODER, SCENE_DECODER, DecoderFile, decoder_name
from gspure.schemes.gs_hider.model import DecoderKey, FeatureModel
from gspure.schemes.pair import Pair
from gspure.schemes.scheme import ADAPTIVE, MESSAGE, PYTORCH, Run, Scheme, initial_gaussians
from gspure.settings import Amount, MaxGaussians, Range, Steps
from gspure.training.trainer import watched

ITERATIONS: Final = 2_000  # ours, for small views; the authors take 50 000 for large ones
MESSAGE_WEIGHT: Final = 0.5  # lambda, the authors' for a hidden scene


def embed(
    pair: Pair,
    seed: int,
    device: Device | None = None,
    *,
    iterations: Steps = ITERATIONS,
    message_weight: Amount = MESSAGE_WEIGHT,
    max_gaussians: MaxGaussians = 30_000,
    constant_rate: Annotated[int, Range(0, 1)] = 0,
    hardened: Amount = 0.0,
) -> tuple[FeatureModel, DecoderKey | None]:
    """Hide the pair's message in its scene; a message weight of 0 gives the scene's clean model, and no key.

    `message_weight` is the share of the message's loss, that of the scene is 1; `max_gaussians` bounds growth.
    With a `constant_rate` of 1, the authors', the decoders' learning rate does not fall at the end. `hardened` trains
    the message also without the rows that ``plain_weight`` removes with this tau, 0 as in the paper.

    Raise `InputError` if a setting is out of range, or PyTorch is missing.
    """
    begin = initial_gaussians(pair, max_gaussians, seed)
    from gspure.schemes.gs_hider.training import Training

    settings = Run(pair, iterations, message_weight, max_gaussians, seed, device or choose_device(), hardened)
    run = Training(settings, begin, falls=not constant_rate)
    for _ in watched(run, iterations, lambda: f"{pair.quality(*run.views)}  {len(run.field)} Gaussians"):
        pass
    roles = ((SCENE_DECODER, MESSAGE_DECODER), run.branches)
    decoders = [DecoderFile.of(branch.decoder, iterations, role) for role, branch in zip(*roles, strict=False)]
    return FeatureModel(run.field.model(), decoders[0]), DecoderKey(decoders[1]) if message_weight else None


READS = ("x", "y", "z", "semantic_*", "opacity", "scale_*", "rot_*")

SCHEME = Scheme(
    "gs_hider",
    embed,
    FeatureModel.read,
    DecoderKey.read,
    {MESSAGE: READS, ADAPTIVE: READS},
    signature=("semantic_0",),
    beside=(decoder_name("*", SCENE_DECODER),),
    packages=PYTORCH,
    fits=True,
)

HARDENED = replace(SCHEME, name="gs_hider_hardened", embed=partial(embed, hardened=2.0))
