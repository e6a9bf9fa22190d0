"""SSIM of batches of images, in the form of 3DGS."""

from functools import cache
from typing import Any

import numpy as np

from gspure.arrays import Float32
from gspure.opencl.device import choose_device
from gspure.opencl.engine import Engine
from gspure.opencl.losses import Photograph, Planes
from gspure_torch.pytorch import on_host, torch


def fused_ssim(
    img1: torch.Tensor,
    img2: torch.Tensor,
    padding: str = "same",
    train: bool = True,  # noqa: ARG001, FBT001, FBT002 -- the interface of fused-ssim
) -> torch.Tensor:
    """Return the mean SSIM of two batches of images [B,C,H,W], with zeros beyond the border; `img1` has a gradient."""
    if padding != "same":
        raise ValueError(f"gspure cuda-free: fused_ssim has the padding 'same', not {padding!r}")
    similarities = [_Similarity.apply(image, reference) for image, reference in zip(img1, img2, strict=True)]
    return torch.stack(similarities).mean()


class _Similarity(torch.autograd.Function):  # type: ignore[misc]
    """The SSIM of two images [C,H,W], as autograd sees it; the device computes its gradient with it."""

    @staticmethod
    def forward(ctx: Any, image: torch.Tensor, reference: torch.Tensor) -> torch.Tensor:
        pixels = _pixels(image)
        planes = _planes(pixels.shape)
        engine = planes.engine
        photograph = Photograph(planes, planes.padded(_pixels(reference)))
        loss, on_device = photograph.compare(engine.buffers.image.holding(pixels), 1.0)
        gradient = engine.read(on_device, pixels.shape, np.float32)
        ctx.gradient = torch.from_numpy(gradient).permute(2, 0, 1).to(image.device)
        return image.new_tensor(1 - loss)

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
    def backward(ctx: Any, similarity_gradient: torch.Tensor) -> tuple[torch.Tensor, None]:
        return -similarity_gradient * ctx.gradient, None


def _pixels(image: torch.Tensor) -> Float32:
    """Return an image [C,H,W] as an array [H,W,C]."""
    return np.ascontiguousarray(on_host(image).transpose(1, 2, 0), np.float32)


@cache
def _planes(shape: tuple[int, int, int]) -> Planes:
    return Planes(_engine(), *shape)


@cache
def _engine() -> Engine:
    return Engine(choose_device().cl_device)
