"""The decoder: a small network, trained here from scratch, that reads bits from an image.

It learns from photographs with added textures, one of two per bit, as HiDDeN (Zhu et al. 2018) learns from photographs
and an encoder. The textures are learned, too, and serve no other purpose: the clones show whatever the decoder reads.
All numbers are ours.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Final

import numpy as np

from gspure.arrays import Float32
from gspure_torch.pytorch import torch

FILTERS: Final = 64  # number of filters
SIDE: Final = 9  # of a filter, in pixels of half the resolution
WINDOW: Final = 9  # side of the window of local mean and contrast, in pixels
FLOOR: Final = 0.01  # contrast below which an area counts as flat
TILE: Final = 32  # side of a texture, which repeats, in pixels
CYCLES: Final = (2, 6)  # range of the first textures' frequencies, in cycles per tile
STRENGTHS: Final = (0.2, 0.03)  # root mean square of all bits' textures, from the first to the last step; log-linear
NOISE: Final = 0.02  # largest noise in training
ZOOM: Final = 0.1  # largest change of the scale's logarithm in training
TURN: Final = 0.1  # largest rotation in training, radians

CROP: Final = 64
BATCH: Final = 16
RATE: Final = 5e-3

_mean = partial(torch.nn.functional.avg_pool2d, stride=1, count_include_pad=False)


class Decoder(torch.nn.Module):  # type: ignore[misc]
    """Linear filters of an image of any size, and a linear layer of the logarithms of their energies."""

    def __init__(self, count: int) -> None:
        super().__init__()
        self.filters = torch.nn.Conv2d(3, FILTERS, SIDE, padding=SIDE // 2)
        self.head = torch.nn.Linear(FILTERS, count)

    def forward(self, images: torch.Tensor) -> torch.Tensor:
        """Return the logits [B,N] of the bits in images [B,3,H,W]."""
        window = [min(2, side) for side in images.shape[2:]]
        responses = self.filters(torch.nn.functional.avg_pool2d(_flattened(images), window))
        return self.head((responses.square().mean(dim=(2, 3)) + 1e-6).log())


def untrained(count: int, seed: int) -> Decoder:
    """Return a decoder of `count` bits; PyTorch's global random state is left unchanged."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return Decoder(count)


def training(
    decoder: Decoder,
    photographs: Sequence[Float32],
    steps: int,
    rng: np.random.Generator,
    disturb: Callable[[torch.Tensor, np.random.Generator], torch.Tensor],
) -> Iterator[float]:
    """Train a decoder on random bits in disturbed crops of photographs [H,W,3]; yield the loss of each step."""
    count = decoder.head.out_features
    textures = torch.from_numpy(_gratings(2 * count, rng).reshape(2, count, 3, TILE, TILE)).requires_grad_()
    groups = [{"params": [*decoder.parameters()]}, {"params": [textures], "lr": 10 * RATE}]
    optimizer = torch.optim.Adam(groups, RATE)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, [RATE, 10 * RATE], steps)
    for strength in np.geomspace(*STRENGTHS, steps):
        bits = torch.from_numpy(rng.random((BATCH, count)) < 0.5)
        images = _crops(photographs, rng)
        added = torch.where(bits[..., None, None, None], *textures).sum(1)
        added = warped(added.repeat(1, 1, 5, 5), rng, images.shape[2:])
        marked = images + strength * added / added.square().mean(dim=(1, 2, 3), keepdim=True).sqrt()
        loss = torch.nn.functional.binary_cross_entropy_with_logits(decoder(disturb(marked, rng)), bits.float())
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
        yield float(loss.detach())


def _gratings(count: int, rng: np.random.Generator) -> Float32:
    """Return sinusoidal textures [count,3,T,T] of random colours, of different frequencies while there are enough."""
    columns, rows = (grid.ravel() for grid in np.meshgrid(np.arange(-TILE, TILE), np.arange(TILE)))
    radii = np.hypot(columns, rows)
    half = np.flatnonzero((CYCLES[0] <= radii) & (radii <= CYCLES[1]) & ((rows > 0) | (columns > 0)))
    chosen = np.resize(rng.permutation(half), count)[:, None, None]
    places = np.arange(TILE)
    phases = 2 * np.pi / TILE * (columns[chosen] * places + rows[chosen] * places[:, None])
    return (rng.normal(size=(count, 3, 1, 1)) * np.cos(phases)[:, None]).astype(np.float32)


def warped(images: torch.Tensor, rng: np.random.Generator, size: Sequence[int]) -> torch.Tensor:
    """Return windows [B,C,*size] of images [B,C,H,W], at random places, somewhat scaled and rotated."""
    count = len(images)
    height, width = images.shape[2:]
    zoom = np.exp(rng.uniform(-ZOOM, ZOOM, count))
    turn = rng.uniform(-TURN, TURN, count)
    sine = zoom * np.sin(turn)
    cosine = zoom * np.cos(turn)
    shares = np.array([[size[1] / width, size[0] / width], [size[1] / height, size[0] / height]])
    room = [np.maximum(1 - share * (np.abs(cosine) + np.abs(sine)), 0) for share in np.diag(shares)]
    across, down = (rng.uniform(-1, 1, count) * space for space in room)
    (a, b), (c, d) = shares
    matrices = np.stack([cosine * a, -sine * b, across, sine * c, cosine * d, down], axis=1)
    affine = torch.from_numpy(matrices.reshape(count, 2, 3).astype(np.float32))
    grid = torch.nn.functional.affine_grid(affine, (count, 1, *size), align_corners=False)
    return torch.nn.functional.grid_sample(images, grid, padding_mode="reflection", align_corners=False)


def disturbed(images: torch.Tensor, rng: np.random.Generator) -> torch.Tensor:
    """Return images with noise, sometimes blurred."""
    if rng.random() < 0.3:
        images = _mean(images, 3, padding=1)
    noise = rng.uniform(0, NOISE) * rng.standard_normal(images.shape, np.float32)
    return (images + torch.from_numpy(noise.astype(np.float32))).clip(0, 1)


def _flattened(images: torch.Tensor) -> torch.Tensor:
    """Return images with local mean 0 and, except in flat areas, local contrast 1."""
    local_mean = partial(_mean, kernel_size=WINDOW, padding=WINDOW // 2)
    residual = images - local_mean(images)
    return residual / (local_mean(residual.square().mean(dim=1, keepdim=True)) + FLOOR**2).sqrt()


def _crops(photographs: Sequence[Float32], rng: np.random.Generator) -> torch.Tensor:
    """Return random windows [B,3,S,S] of photographs, half of them mirrored."""
    side = min(CROP, *(length for image in photographs for length in image.shape[:2]))
    crops = []
    for number in rng.integers(len(photographs), size=BATCH):
        photograph = photographs[number]
        row, column = (int(rng.integers(length - side + 1)) for length in photograph.shape[:2])
        crop = photograph[row : row + side, column : column + side]
        crops.append(crop[:, ::-1] if rng.random() < 0.5 else crop)
    return torch.from_numpy(np.stack(crops).transpose(0, 3, 1, 2).copy())
