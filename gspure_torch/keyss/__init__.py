"""KeySS (Ren et al. 2025): with a key, a network turns the Gaussians of a vanilla model into those of the message.

Gaussians and network learn together. From the paper: the network, the weights of the losses (0.5 scene, 0.5 message,
0.01 wrong key) and AdamW. Ours: a wrong key should add nothing to the public rows; the message does not train public
opacities; the network's learning rate; training starts from points, with the densification of 3DGS, not from a trained
model of the scene.
"""

from dataclasses import replace
from functools import partial
from typing import Annotated

from gspure.metrics.targets import ADAPTIVE, MESSAGE
from gspure.opencl.device import Device, choose_device
from gspure.public_model import PublicModel
from gspure.schemes.pair import Pair
from gspure.schemes.scheme import Run, Scheme
from gspure.settings import Amount, MaxGaussians, Range, Steps
from gspure.training.trainer import watched
from gspure_torch import PYTORCH
from gspure_torch.keyss.key import NetworkKey
from gspure_torch.keyss.network import RATE, gaussians_of


def embed(
    pair: Pair,
    seed: int,
    device: Device | None = None,
    *,
    iterations: Steps = 3000,
    message_weight: Amount = 1.0,
    network_rate: Annotated[float, Range(1e-9, 1.0)] = RATE,
    max_gaussians: MaxGaussians = 30_000,
    canonical: Annotated[int, Range(0, 1)] = 0,
) -> tuple[PublicModel, NetworkKey | None]:
    """Hide the pair's message in its scene; a message weight of 0 gives the scene's clean model, and no key.

    `message_weight` is the weight of the message's loss (the scene's is 1), `network_rate` the network's initial
    learning rate, `max_gaussians` the limit of densification. With a `canonical` of 1, ours, the network reads rows in
    canonical frames, so that the attack `gauge` does not affect the message. Needs PyTorch.
    """
    begin = pair.initial_gaussians(max_gaussians, seed)
    from gspure_torch.keyss.training import Training

    settings = Run(pair, iterations, message_weight, max_gaussians, seed, device or choose_device())
    run = Training(settings, begin, network_rate, is_canonical=bool(canonical))
    for _ in watched(run, iterations, lambda: f"{len(run.rows)} Gaussians"):
        pass
    public = PublicModel(gaussians_of(run.rows.values))
    if not message_weight:
        return public, None
    return public, NetworkKey(run.key, run.learner.network(), bool(canonical))


READS = dict.fromkeys((MESSAGE, ADAPTIVE), ("x", "y", "z", "f_dc_*", "f_rest_*", "opacity", "scale_*", "rot_*"))

CARRIERS = ("f_dc_*", "f_rest_*", "opacity", "scale_*", "rot_*")  # all that the network reads, but the positions

SCHEME = Scheme(
    "keyss",
    embed,
    PublicModel.read,
    NetworkKey.read,
    READS,
    packages=PYTORCH,
    carriers=CARRIERS,
    fits=True,
)
CANONICAL = replace(SCHEME, name="keyss_canonical", embed=partial(embed, canonical=1))
