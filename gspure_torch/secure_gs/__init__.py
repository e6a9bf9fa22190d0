"""SecureGS (Zhang et al. 2025) on Scaffold-GS: public anchors, from which private networks compute other Gaussians.

Anchors, public and private networks learn together. The paper leaves some choices open. Ours: the loss is L(scene) +
message_weight L(message), each with Scaffold-GS's volume term; anchors grow by the gradients of both branches and are
pruned if neither uses them.
"""

from dataclasses import replace
from functools import partial, wraps
from typing import Annotated, Any

import numpy as np

from gspure.constants import ANCHOR_TAU_C, ANCHOR_TAU_N
from gspure.metrics.targets import ADAPTIVE, MESSAGE
from gspure.opencl.device import Device, choose_device
from gspure.schemes.pair import Pair
from gspure.schemes.scheme import Run, Scheme
from gspure.settings import SCHEDULES, Amount, Range, Steps
from gspure.training.trainer import watched
from gspure_torch import PYTORCH
from gspure_torch.reference import Reference
from gspure_torch.secure_gs.anchors import PRIVATE, PUBLIC, fresh
from gspure_torch.secure_gs.initialization import (
    FEAT_DIM,
    FIRST_SHARE,
    GAUSSIANS_PER_ANCHOR,
    LEAST_ANCHORS,
    first_anchors,
)
from gspure_torch.secure_gs.key import HiddenKey
from gspure_torch.secure_gs.model import NETWORKS, AnchorModel


def embed(
    pair: Pair,
    seed: int,
    device: Device | None = None,
    *,
    iterations: Steps = 2000,
    message_weight: Amount = 0.5,
    max_anchors: Annotated[int, Range(LEAST_ANCHORS, 10_000_000)] = 4000,
    density: Annotated[float, Range(1.0, 1e6)] = 2.0,
    hardened: Amount = 0.0,
    schedule: str = SCHEDULES[0],
) -> tuple[AnchorModel, HiddenKey | None]:
    """Hide the pair's message in its scene; a message weight of 0 gives the scene's clean model, and no key.

    `message_weight` is the weight of the message's loss (the scene's is 1). `density` is r_down of the region-aware
    density optimization (`gspure_torch.secure_gs.growing`); 1 switches it off. `hardened` trains the message also
    without the anchors that ``plain_weight`` removes with this tau; 0 trains as in the paper, as does the vanilla
    `schedule`. Needs PyTorch.
    """
    from gspure_torch.secure_gs.training import Training

    rng = np.random.default_rng(seed)
    anchors, voxel = first_anchors([xyz for xyz, _ in pair.clouds], int(FIRST_SHARE * max_anchors))
    public_networks = fresh(PUBLIC, FEAT_DIM, GAUSSIANS_PER_ANCHOR, rng)
    private_networks = fresh(PRIVATE, FEAT_DIM, GAUSSIANS_PER_ANCHOR, rng)
    branches = [public_networks, private_networks] if message_weight else [public_networks]
    device = device or choose_device()
    settings = Run(pair, iterations, message_weight, max_anchors, seed, device, hardened, schedule)
    run = Training(settings, anchors, voxel, branches, density)
    for _ in watched(run, iterations, lambda: f"{len(run.learner.anchors.positions)} anchors"):
        pass
    if not message_weight:
        return run.public(), None
    return run.public(), HiddenKey(run.learner.networks(1))


@wraps(embed)
def embed_canonical(*arguments: Any, **settings: Any) -> tuple[AnchorModel, HiddenKey | None]:
    """Hide as `embed` does; the key undoes mixes of features (`gspure_torch.reference`). Ours."""
    public, key = embed(*arguments, **settings)
    return public, key and HiddenKey(key.networks, Reference.of(public))


READS = dict.fromkeys((MESSAGE, ADAPTIVE), ("x", "y", "z", "f_anchor_feat_*", "scale_*"))
"""Without the offsets, which only the scene uses, and the opacities and rotations, which are unused constants."""

SCHEME = Scheme(
    "secure_gs",
    embed,
    AnchorModel.read,
    HiddenKey.read,
    READS,
    ANCHOR_TAU_C,
    ANCHOR_TAU_N,
    signature=("f_anchor_feat_0", "f_offset_0"),
    beside=(NETWORKS,),
    packages=PYTORCH,
    carriers=("f_anchor_feat_*",),
    fits=True,
)

HARDENED = replace(SCHEME, name="secure_gs_hardened", embed=partial(embed, hardened=2.0))
CANONICAL = replace(SCHEME, name="secure_gs_canonical", embed=embed_canonical)
