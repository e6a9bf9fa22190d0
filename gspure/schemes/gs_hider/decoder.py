"""The network that decodes an image from a feature map: the scene (public) or the message (private)."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

from gspure.cameras.camera import Camera
from gspure.files import Float32
from gspure.model.finite import require_computed
from gspure.opencl.losses import Photographs
from gspure.public_model import RenderView
from gspure.training.pytorch import torch

CHANNELS: Final = 16  # features of a Gaussian, as `gspure.schemes.gs_hider.files` names them

WIDTH: Final = 64
LAYERS: Final = 5

BFLOAT16: Final = torch.cpu._is_avx512_bf16_supported()  # noqa: SLF001  (PyTorch 2.6 has no public function)
"""Whether training multiplies in bfloat16, at twice the speed; sums, parameters and their moments have 32 bits."""


class Decoder(torch.nn.Module):  # type: ignore[misc]
    """Five convolutions of 3 x 3 with ReLU between them, as in GS-Hider: 121 795 parameters."""

    def __init__(self) -> None:
        super().__init__()
        widths = (CHANNELS, *[WIDTH] * (LAYERS - 1), 3)
        for i in range(LAYERS):
            self.add_module(f"conv{i + 1}", torch.nn.Conv2d(widths[i], widths[i + 1], 3, padding=1))
        self.to(memory_format=torch.channels_last)

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
    decoder: Decoder, feature_map: Float32, photographs: Photographs, view: int, weight: float = 1.0
) -> tuple[float, Float32]:
    """Return the weighted loss of a decoder's image, and its gradient with respect to the feature map."""
    features = torch.from_numpy(feature_map).requires_grad_()
    with torch.autocast("cpu", torch.bfloat16, enabled=BFLOAT16):
        image = decoder(features).float()
    loss, gradient = photographs.compare(view, image.detach().contiguous().numpy())
    decoder.zero_grad()
    image.backward(weight * torch.from_numpy(gradient))
    return weight * loss, features.grad.numpy()


def decoded(feature_map: Callable[[Camera], Float32], decoder: Decoder, source: str | Path = "decoder") -> RenderView:
    """Return the renderer of the image that a decoder computes from a feature map."""

    def view(camera: Camera) -> Float32:
        with torch.inference_mode():
            image: Float32 = decoder(torch.from_numpy(feature_map(camera))).contiguous().numpy()
        require_computed(image, source, "image")
        return image

    return view
