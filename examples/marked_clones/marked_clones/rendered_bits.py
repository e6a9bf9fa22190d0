"""Rendered Bits, of the family of GuardSplat (Chen et al. 2024, arXiv 2411.19895), in the smallest form; all is ours.

Embedding trains the scene; a decoder on crops of the scene's renders, with image attacks between textures and decoder;
and then the colours of all rows, until the decoder reads the bits from renders. Geometry and opacity do not change.
GuardSplat trains its decoder on CLIP's features of texts instead, and offsets of the harmonics.
"""

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import numpy as np

from gspure.arrays import Bools, Float32
from gspure.attacks.renders import blur, brightness, jpeg, pixel_noise, resize, resized_crop
from gspure.cameras.camera import Camera
from gspure.images import read_back
from gspure.metrics.targets import BITS
from gspure.model import Gaussians
from gspure.opencl.device import Device, choose_device
from gspure.public_model import PublicModel
from gspure.renderer import Renderer
from gspure.schemes.keyed_pattern import copied
from gspure.schemes.pair import Pair
from gspure.schemes.scheme import Key, Scheme
from gspure.settings import Amount, MaxGaussians, Range, Steps
from gspure_torch import PYTORCH
from marked_clones import RENDERED, trained

if TYPE_CHECKING:
    import torch

    from marked_clones.decoder import Decoder

FIDELITY: Final = 10.0  # weight of the difference to the clean model's render
RATE: Final = 0.01  # of the colours, falling to a tenth

ATTACKS: Final[dict[Any, tuple[str, float, float]]] = {
    jpeg: ("quality", 50, 95),
    blur: ("radius", 0.0, 1.5),
    resized_crop: ("area", 0.6, 1.0),
    resize: ("scale", 0.5, 1.0),
    pixel_noise: ("sigma", 0.0, 0.05),
    brightness: ("factor", 0.7, 1.5),
}
"""Image attacks of training, each with a setting and its range."""


def embed(
    pair: Pair,
    seed: int,
    device: Device | None = None,
    *,
    iterations: Steps = 2000,
    message_weight: Amount = 0.3,
    max_gaussians: MaxGaussians = 20_000,
    bits: Annotated[int, Range(7, 4096)] = 16,
    decoder_steps: Steps = 600,
    colour_steps: Steps = 200,
) -> tuple[PublicModel, Key | None]:
    """Hide random bits in the colours of the pair's scene; a message weight of 0 gives its clean model, and no key.

    The scene is trained for `iterations`, the decoder for `decoder_steps`, the colours for `colour_steps`. Bits depend
    on the seed and on the scene's photographs.
    """
    begin = replace(pair, initialization="scene").initial_gaussians(max_gaussians, seed)
    device = device or choose_device()
    views = pair.scene.views
    model = pair.scene.trained(begin, iterations, max_gaussians, seed, device)
    if not message_weight:
        return PublicModel(model), None
    from gspure_torch.pytorch import single_threaded
    from marked_clones.decoder import training, untrained
    from marked_clones.key import BitsKey

    rng = np.random.default_rng([seed, zlib.crc32(b"".join(image.tobytes() for image in pair.scene.images))])
    message = rng.random(bits) < 0.5
    decoder = untrained(bits, int(rng.integers(1 << 31)))
    render = Renderer(model, device).image
    renders = [read_back(render(view)) for view in views]
    with single_threaded():
        trained(training(decoder, renders, decoder_steps, rng, attacked), decoder_steps, "decoder")
        colours = Colours(model, device)
        steps = colours.steps(views, renders, decoder, message, message_weight, colour_steps, rng)
        trained(steps, colour_steps, "colours")
    return PublicModel(colours.model), BitsKey(message, decoder)


def attacked(images: "torch.Tensor", rng: np.random.Generator) -> "torch.Tensor":
    """Return images [B,3,H,W], each after a random image attack; gradients pass through the attacks unchanged."""
    import torch

    changed = []
    for image in images.detach().permute(0, 2, 3, 1).numpy():
        attack = [*ATTACKS][rng.integers(len(ATTACKS))]
        setting, low, high = ATTACKS[attack]
        value = rng.uniform(low, high)
        if low > 1:  # a setting that is a whole number
            value = round(value)
        changed.append(attack(image.clip(0, 1), rng, **{setting: value}).clip(0, 1))
    after = torch.from_numpy(np.stack(changed)).permute(0, 3, 1, 2)
    return images + (after - images).detach()


class Colours:
    """The colours of a model while they learn to show bits."""

    def __init__(self, model: Gaussians, device: Device) -> None:
        from marked_clones.marking import Scene

        self._model = model
        self._scene = Scene(model, device)
        self._colours = self._scene.tensors["sh_coeffs"].requires_grad_()

    def steps(
        self,
        cameras: Sequence[Camera],
        renders: Sequence[Float32],
        decoder: "Decoder",
        bits: Bools,
        weight: float,
        count: int,
        rng: np.random.Generator,
    ) -> Iterator[float]:
        """Train `count` steps, each on a camera whose clean render is known; yield the loss of each."""
        import torch

        decoder.requires_grad_(requires_grad=False)
        truth = torch.from_numpy(bits.astype(np.float32)).expand(2, -1)
        optimizer = torch.optim.Adam([self._colours], RATE, eps=1e-15)
        schedule = torch.optim.lr_scheduler.LinearLR(optimizer, 1.0, 0.1, count)
        for number in rng.integers(len(cameras), size=count):
            image = self._scene.image(cameras[number])
            render = image.permute(2, 0, 1)[None].clip(0, 1)
            logits = decoder(torch.cat([render, attacked(render, rng)]))
            error = torch.nn.functional.binary_cross_entropy_with_logits(logits, truth)
            loss = FIDELITY * (image - torch.from_numpy(renders[number])).abs().mean() + weight * error
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
            yield float(loss.detach())

    @property
    def model(self) -> Gaussians:
        """The model with the trained colours."""
        return self._model.with_appearance(self._model.table["opacity"], self._colours.detach().numpy())


def read_key(folder: Path) -> Key:
    """Read a key, or raise `InputError`."""
    from marked_clones.key import BitsKey

    return BitsKey.read(folder)


SCHEME = Scheme("rendered_bits", embed, PublicModel.read, read_key, {BITS: RENDERED}, packages=PYTORCH, copy=copied)
