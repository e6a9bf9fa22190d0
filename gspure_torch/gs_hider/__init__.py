"""GS-Hider (Zhang et al. 2024): one feature map; a public network decodes the scene, a private one the message."""

from dataclasses import replace
from functools import partial, wraps
from typing import Annotated, Any

from gspure.metrics.targets import ADAPTIVE, MESSAGE
from gspure.opencl.device import Device, choose_device
from gspure.schemes.pair import Pair
from gspure.schemes.scheme import Run, Scheme
from gspure.settings import SCHEDULES, Amount, MaxGaussians, Range, Steps
from gspure.training.trainer import watched
from gspure_torch import PYTORCH
from gspure_torch.gs_hider.key import DecoderKey
from gspure_torch.gs_hider.model import MESSAGE_DECODER, SCENE_DECODER, DecoderFile, FeatureModel, decoder_name
from gspure_torch.reference import Reference


def embed(
    pair: Pair,
    seed: int,
    device: Device | None = None,
    *,
    iterations: Steps = 2000,  # ours, for small views; the authors take 50 000 for large ones
    message_weight: Amount = 0.5,  # the authors' for a hidden scene
    max_gaussians: MaxGaussians = 30_000,
    constant_rate: Annotated[int, Range(0, 1)] = 0,
    hardened: Amount = 0.0,
    schedule: str = SCHEDULES[0],
) -> tuple[FeatureModel, DecoderKey | None]:
    """Hide the pair's message in its scene; a message weight of 0 gives the scene's clean model, and no key.

    `message_weight` is the weight of the message's loss (the scene's is 1); `max_gaussians` bounds growth. With a
    `constant_rate` of 1, as in the authors' code, the decoders' learning rate does not fall at the end. `hardened`
    trains the message also without the rows that ``plain_weight`` removes with this tau; 0 trains as in the paper, as
    does the vanilla `schedule`. Needs PyTorch.
    """
    begin = pair.initial_gaussians(max_gaussians, seed)
    from gspure_torch.gs_hider.training import Training

    device = device or choose_device()
    settings = Run(pair, iterations, message_weight, max_gaussians, seed, device, hardened, schedule)
    run = Training(settings, begin, falls=not constant_rate)
    for _ in watched(run, iterations, lambda: f"{len(run.rows)} Gaussians"):
        pass
    scene_decoder = DecoderFile.from_network(run.branches[0].decoder, iterations, SCENE_DECODER)
    public = FeatureModel(run.model(), scene_decoder)
    if not message_weight:
        return public, None
    return public, DecoderKey(DecoderFile.from_network(run.branches[1].decoder, iterations, MESSAGE_DECODER))


@wraps(embed)
def embed_canonical(*arguments: Any, **settings: Any) -> tuple[FeatureModel, DecoderKey | None]:
    """Hide as `embed` does; the key undoes mixes of features (`gspure_torch.reference`). Ours."""
    public, key = embed(*arguments, **settings)
    return public, key and DecoderKey(key.decoder, Reference.of(public))


READS = dict.fromkeys((MESSAGE, ADAPTIVE), ("x", "y", "z", "semantic_*", "opacity", "scale_*", "rot_*"))

SCHEME = Scheme(
    "gs_hider",
    embed,
    FeatureModel.read,
    DecoderKey.read,
    READS,
    signature=("semantic_0",),
    beside=(decoder_name("*", SCENE_DECODER),),
    packages=PYTORCH,
    carriers=("semantic_*",),
    fits=True,
)
HARDENED = replace(SCHEME, name="gs_hider_hardened", embed=partial(embed, hardened=2.0))
CANONICAL = replace(SCHEME, name="gs_hider_canonical", embed=embed_canonical)
