"""Clones of the rows of high uncertainty, trained until a decoder reads the bits from renders; other rows are fixed.

GaussianMarker (Huang et al. 2024) estimates uncertainty by a Laplace approximation. Here, the information of a value
is the expected square of its gradient for an image gradient of random signs, that is, the diagonal of the Fisher matrix
(Hutchinson). The uncertainty of a row is minus the sum of its logarithms, so units do not affect the order of rows.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from gspure.arrays import Bools
from gspure.cameras.camera import Camera, looking_at, spread
from gspure.model import Gaussians
from gspure.model.gaussians import LEAST_OPACITY, logit
from gspure.opencl.device import Device
from gspure.public_model import Rows
from gspure_torch.bridge import TorchRenderer
from gspure_torch.pytorch import torch
from marked_clones.decoder import Decoder, disturbed, warped

RGB_WEIGHT: Final = 10.0  # of the difference to the clean model's render; that of the bits is 1 (GaussianMarker)

RATES: Final = {"means": 1e-4, "quats": 1e-3, "log_scales": 5e-3, "opacity_logits": 0.05, "sh_coeffs": 5e-3}
"""Learning rates, those of the means as a share of the views' extent. Ours."""

BETWEEN: Final = 0.3  # largest step from one training view towards another, as a share of the way; ours
PRIOR: Final = 1e-3  # information that every parameter has before any view, relative to the mean of its kind; ours


class Scene:
    """Tensors of a model that the renderer differentiates."""

    def __init__(self, model: Gaussians, device: Device | None) -> None:
        raw = (model.means, model.quats, model.log_scales, model.table["opacity"], model.sh_coeffs)
        self.tensors = {name: torch.from_numpy(values.copy()) for name, values in zip(RATES, raw, strict=True)}
        self._render = TorchRenderer(device)

    def image(self, camera: Camera, clones: dict[str, torch.Tensor] | None = None) -> torch.Tensor:
        """Return the image [H,W,3] of the model and its clones."""
        rows = self.tensors
        if clones:
            rows = {name: torch.cat([tensor, clones[name]]) for name, tensor in rows.items()}
        return self._render(
            camera,
            rows["means"],
            rows["quats"],
            rows["log_scales"].exp(),
            rows["opacity_logits"].sigmoid(),
            sh_coeffs=rows["sh_coeffs"],
        )


def uncertain_rows(
    model: Gaussians, cameras: Sequence[Camera], share: float, rng: np.random.Generator, device: Device | None
) -> Rows:
    """Return the rows of highest uncertainty, a share of all that some view shows."""
    scene = Scene(model, device)
    information = {name: torch.zeros_like(rows) for name, rows in scene.tensors.items()}
    for camera in cameras:
        for rows in scene.tensors.values():
            rows.requires_grad_().grad = None
        image = scene.image(camera)
        image.backward(torch.from_numpy(rng.choice(np.array([-1, 1], np.float32), image.shape)))
        for name, rows in scene.tensors.items():
            information[name] += rows.grad.square()
    certainty = np.zeros(len(model))
    is_visible = np.zeros(len(model), np.bool_)
    for tensor in information.values():
        values = tensor.numpy().astype(np.float64).reshape(len(model), -1)
        certainty += np.log(values + PRIOR * values.mean() + np.finfo(np.float64).tiny).sum(axis=1)
        is_visible |= values.any(axis=1)
    rows = np.flatnonzero(is_visible)
    return np.sort(rows[np.argsort(certainty[rows], kind="stable")[: round(share * len(rows))]])


class Marking:
    """A run; iterating over it trains clones of `rows` and yields the loss of each step."""

    def __init__(self, model: Gaussians, rows: Rows, decoder: Decoder, bits: Bools, device: Device | None) -> None:
        logits = model.table["opacity"].copy()
        logits[rows] = logit(1 - np.sqrt(1 - model.opacities[rows]), LEAST_OPACITY)
        self._clean = Scene(model, device)
        self._scene = Scene(model.with_columns({"opacity": logits}), device)
        self._clones = {name: tensor[rows].clone().requires_grad_() for name, tensor in self._scene.tensors.items()}
        self._decoder = decoder.requires_grad_(requires_grad=False)
        truth = torch.from_numpy(bits.astype(np.float32))[None]
        self._error = partial(torch.nn.functional.binary_cross_entropy_with_logits, target=truth)

    def steps(self, cameras: Sequence[Camera], weight: float, count: int, rng: np.random.Generator) -> Iterator[float]:
        """Train `count` steps, each on a view near one of `cameras`; `weight` is that of the bits."""
        rates = RATES | {"means": RATES["means"] * spread(cameras)}
        groups = [{"params": [tensor], "lr": rates[name]} for name, tensor in self._clones.items()]
        optimizer = torch.optim.Adam(groups, eps=1e-15)
        schedule = torch.optim.lr_scheduler.LinearLR(optimizer, 1.0, 0.1, count)
        for _ in range(count):
            first, second = rng.integers(len(cameras), size=2)
            camera = _between(cameras[first], cameras[second], BETWEEN * rng.random())
            with torch.no_grad():
                clean = self._clean.image(camera)
            image = self._scene.image(camera, self._clones)
            render = image.permute(2, 0, 1)[None]
            size = [round(3 * length / 4) for length in render.shape[2:]]
            views = [disturbed(render, rng), disturbed(warped(render, rng, size), rng)]
            error = sum(self._error(self._decoder(view)) for view in views)
            loss = RGB_WEIGHT * (image - clean).abs().mean() + weight * error / len(views)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
            yield float(loss.detach())

    @property
    def model(self) -> Gaussians:
        """The model with its clones behind all other rows."""
        merged = {
            name: torch.cat([rows, self._clones[name].detach()]).numpy() for name, rows in self._scene.tensors.items()
        }
        return Gaussians.from_stored(**merged)


def _between(start: Camera, end: Camera, share: float) -> Camera:
    """Return the view at a share of the way from one camera to another."""
    first = np.stack([start.centre, start.viewmat[2, :3], start.viewmat[1, :3]])
    second = np.stack([end.centre, end.viewmat[2, :3], end.viewmat[1, :3]])
    centre, forward, down = (1 - share) * first + share * second
    return replace(start, viewmat=looking_at(centre, centre + forward, -down))
