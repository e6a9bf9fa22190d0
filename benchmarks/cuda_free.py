"""CPU time of a step of a trainer in the style of 3DGS, against a step of gspure's own trainer, measured in turns.

``gspure cuda-free -- python -m benchmarks.cuda_free [ROUNDS]`` writes the ratios to cuda_free.csv. The trainer takes
its optimizer from PyTorch, and its loss from fused-ssim, which gspure replaces, too.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from diff_gaussian_rasterization import GaussianRasterizationSettings, GaussianRasterizer
from fused_ssim import fused_ssim

from benchmarks.bench_training import AT_REST, trainable
from benchmarks.room import camera, room
from benchmarks.stages import Stages
from benchmarks.timing import Times, one_round
from gspure.cameras.camera import Camera
from gspure.files import write_text
from gspure.metrics.csv_tables import csv_text
from gspure.model import Gaussians
from gspure.opencl.frame import Traversal
from gspure.opencl.passes import backward, forward

CASES = {"30k @208x156": (30_000, 208, 156), "200k @640x480": (200_000, 640, 480)}
TABLE = Path(__file__).with_name("cuda_free.csv")
COLUMNS = ("case", "step", "step, with gspure's passes", "rasterizer")
RATES = {"xyz": 1.6e-4, "f_dc": 2.5e-3, "f_rest": 1.25e-4, "opacity": 0.05, "scaling": 5e-3, "rotation": 1e-3}
NAMES = ("means", "quats", "scales", "opacities", "sh_coeffs")


def rasterizer(view: Camera) -> Any:
    """Return the rasterizer of a view at the origin."""
    tangents = [view.width / view.K[0, 0] / 2, view.height / view.K[1, 1] / 2]
    projection = torch.diag(torch.tensor([1 / tangents[0], 1 / tangents[1], 1.0, 0.0]))
    projection[2:, 2:] = torch.tensor([[1.0, 1.0], [-0.01, 0.0]])
    size = (view.height, view.width, *tangents)
    background = torch.zeros(3, device="cuda")
    origin = torch.zeros(3, device="cuda")
    settings = (*size, background, 1.0, torch.eye(4).cuda(), projection.cuda(), 3, origin, False, False, False)
    return GaussianRasterizer(GaussianRasterizationSettings(*settings))


class Program:
    """The trainer of a program: its parameters, its optimizer and its step."""

    def __init__(self, model: Gaussians, view: Camera, photograph: np.ndarray) -> None:
        opacities = torch.from_numpy(model.opacities).clamp(1e-6, 1 - 1e-6)
        colours = torch.from_numpy(np.array(model.sh_coeffs))
        values = {
            "xyz": torch.from_numpy(np.array(model.means)),
            "f_dc": colours[:, :1].contiguous(),
            "f_rest": colours[:, 1:].contiguous(),
            "opacity": torch.logit(opacities)[:, None],
            "scaling": torch.from_numpy(model.scales).log(),
            "rotation": torch.from_numpy(np.array(model.quats)),
        }
        self.parameters = {name: torch.nn.Parameter(value.cuda()) for name, value in values.items()}
        groups = [{"params": [value], "lr": 0.0 * RATES[name]} for name, value in self.parameters.items()]
        self.optimizer = torch.optim.Adam(groups, lr=0.0, eps=1e-15)
        self.truth = torch.from_numpy(photograph.transpose(2, 0, 1).copy()).cuda()
        self.rasterizer = rasterizer(view)
        self.norms = torch.zeros(len(model), 1, device="cuda")
        self.counts = torch.zeros(len(model), 1, device="cuda")
        self.largest = torch.zeros(len(model), device="cuda")
        self.gradient = torch.full_like(self.truth, 1e-6)
        self.leaves = {name: value.detach().requires_grad_() for name, value in self.activated().items()}

    def activated(self) -> dict[str, torch.Tensor]:
        """Return the inputs of the rasterizer."""
        raw = self.parameters
        return {
            "means3D": raw["xyz"],
            "means2D": torch.zeros_like(raw["xyz"], requires_grad=True) + 0,
            "shs": torch.cat([raw["f_dc"], raw["f_rest"]], dim=1),
            "opacities": torch.sigmoid(raw["opacity"]),
            "scales": torch.exp(raw["scaling"]),
            "rotations": torch.nn.functional.normalize(raw["rotation"]),
        }

    def step(self) -> None:
        """Render, compare, and move the parameters."""
        inputs = self.activated()
        points = inputs["means2D"]
        points.retain_grad()
        image, radii, _ = self.rasterizer(**inputs)
        image = image.clamp(0, 1)
        l1 = (image - self.truth).abs().mean()
        loss = 0.8 * l1 + 0.2 * (1 - fused_ssim(image[None], self.truth[None]))
        loss.backward()
        loss.item()
        with torch.no_grad():
            visible = (radii > 0).nonzero()
            self.largest[visible] = torch.maximum(self.largest[visible], radii[visible])
            self.norms[visible[:, 0]] += points.grad[visible[:, 0], :2].norm(dim=-1, keepdim=True)
            self.counts[visible[:, 0]] += 1
            self.optimizer.step()
            self.optimizer.zero_grad(set_to_none=True)

    def rasterize(self) -> None:
        """Render the activated inputs, and carry a gradient back to them."""
        image, _, _ = self.rasterizer(**self.leaves)
        torch.autograd.grad(image, [*self.leaves.values()], self.gradient)


def measured(count: int, width: int, height: int, rounds: int) -> dict[str, Times]:
    """Return the times of both steps, and of their forward and backward passes."""
    model = room(count)
    view = camera(width, height)
    photograph = np.random.default_rng(0).random((height, width, 3), np.float32)
    program = Program(model, view, photograph)
    own = trainable(model)
    own.set_targets([photograph])
    stages = Stages(own.engine, model, view, Traversal("ewa", channels=3, sh_degree=3))
    gradient = own.engine.uploaded(np.full(photograph.shape, 1e-6, np.float32))

    def own_step() -> None:
        own.step(view, 0, AT_REST)
        own.engine.queue.finish()

    def own_passes() -> None:
        backward(forward(stages.frame, (0.0, 0.0, 0.0)), gradient)
        own.engine.queue.finish()

    variants: dict[str, Callable[[], None]] = {
        "own step": own_step,
        "program step": program.step,
        "own passes": own_passes,
        "program passes": program.rasterize,
    }
    one_round(variants, {name: Times() for name in variants})
    times = {name: Times() for name in variants}
    for _ in range(rounds):
        one_round(variants, times)
    return times


def ratios(case: str, times: Mapping[str, Times]) -> list[str]:
    """Print times, and return median ratios of CPU time: of the steps, of the steps with our passes, of the passes."""
    for name, values in times.items():
        print(f"{case}  {name:16} {1e3 * np.median(values.cpu):7.1f} CPU-ms")
    own = np.array(times["own step"].cpu)
    program = np.array(times["program step"].cpu)
    excess = np.subtract(times["program passes"].cpu, times["own passes"].cpu)
    passes = np.divide(times["program passes"].cpu, times["own passes"].cpu)
    return [f"{np.median(values):.2f}" for values in (program / own, (program - excess) / own, passes)]


def main(rounds: int) -> None:
    """Write the table."""
    rows = [[case, *ratios(case, measured(*size, rounds))] for case, size in CASES.items()]
    write_text(TABLE, csv_text(COLUMNS, rows))
    print(TABLE.read_text())


if __name__ == "__main__":
    main(rounds=int(sys.argv[1]) if len(sys.argv) > 1 else 21)
