"""The network that decodes an image from a feature map: the scene (public) or the message (private)."""

from itertools import pairwise
from typing import Final

from gspure.arrays import Float32
from gspure.opencl.losses import Photographs
from gspure_torch.pytorch import BFLOAT16, DEVICE, on_device, on_host, torch

WIDTHS: Final = (16, 64, 64, 64, 64, 3)  # of feature map, layers and image


class Decoder(torch.nn.Module):  # type: ignore[misc]
    """Five convolutions of 3 x 3 with ReLU between them, as in GS-Hider: 121 795 parameters."""

    def __init__(self) -> None:
        super().__init__()
        for i, (inputs, outputs) in enumerate(pairwise(WIDTHS), 1):
            self.add_module(f"conv{i}", torch.nn.Conv2d(inputs, outputs, 3, padding=1))
        self.to(DEVICE, memory_format=torch.channels_last)

    def forward(self, feature_map: torch.Tensor) -> torch.Tensor:
        """Return the image [H,W,3], not clipped, of a feature map [H,W,16]."""
        x = feature_map.permute(2, 0, 1)[None]  # channels stay last in memory: the fastest layout for convolutions
        *inner, last = self.children()
        for layer in inner:
            x = torch.relu(layer(x))
        return last(x)[0].permute(1, 2, 0)


def untrained(count: int, seed: int) -> list[Decoder]:
    """Return decoders with PyTorch's default initialization; its global random state is left unchanged."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return [Decoder() for _ in range(count)]


def differentiated(
    feature_map: Float32, view: int, decoder: Decoder, photographs: Photographs, weight: float = 1.0
) -> tuple[float, Float32]:
    """Return the weighted loss of a decoder's image, and its gradient with respect to the feature map."""
    features = on_device(feature_map).requires_grad_()
    with torch.autocast(DEVICE.type, torch.bfloat16, enabled=BFLOAT16):
        image = decoder(features).float()
    loss, gradient = photographs.compare(view, on_host(image.contiguous()))
    decoder.zero_grad()
    image.backward(weight * on_device(gradient))
    return weight * loss, on_host(features.grad)
