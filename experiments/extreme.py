"""Agreement of float32 kernels with the float64 reference on single Gaussians of extreme shapes.

Beside each error stands its condition: the change of alpha if the row's float32 numbers are rounded once more. No
float32 renderer can do much better. ``python -m experiments.extreme``, in a checkout, prints the tables
``extreme-SHAPE.csv`` for this machine's device.
"""

from collections.abc import Iterator
from itertools import product
from typing import Literal, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gspure.cameras.camera import Camera
from gspure.constants import ALPHA_MAX, ALPHA_MIN, NEAR_PLANE, Energy
from gspure.model.gaussians import Gaussians
from gspure.opencl.device import Device, choose_device
from gspure.opencl.engine import Style, suited_style
from gspure.renderer import Renderer
from tests.models import camera, gaussians
from tests.reference.projection import pixel_centres, project

Shape = Literal["flat", "needle"]
SHAPES: tuple[Shape, ...] = ("flat", "needle")
VIEW = camera(48, 33)
ROUNDINGS = 16
ULP = 2.0**-23
ASPECTS = (1.0, 1e2, 1e4, 1e6, 1e8)
ANGLES = (1.0, 1e-2, 1e-4, 1e-6, 0.0)
DEPTHS = (0.201, 1.0, 10.0, 1e3)
DRAWS = 12


class Cell(NamedTuple):
    """A shape of some `aspect` and `depth`; its plane or axis is at `angle` radians from the ray to its centre."""

    shape: Shape
    aspect: float
    angle: float
    depth: float

    def gaussian(self, rng: np.random.Generator) -> Gaussians:
        """Draw a Gaussian in the image or far outside, up to ten pixels in size or so large that it is visible."""
        slopes = rng.uniform(-0.4, 0.4, 2) * rng.choice([1.0, 1.0, 20.0])
        mean = self.depth * np.array([*slopes, 1.0])
        towards = mean / np.linalg.norm(mean)
        across = np.cross(towards, rng.normal(size=3))
        across /= np.linalg.norm(across)
        # The first axis: a disc's normal, nearly perpendicular to the ray, or a needle's length, nearly along it.
        leaning, upright = (towards, across) if self.shape == "flat" else (across, towards)
        first = np.cos(self.angle) * upright + np.sin(self.angle) * leaning
        second = np.cross(first, np.cos(self.angle) * leaning - np.sin(self.angle) * upright)
        turn = Rotation.from_matrix(np.stack([first, second, np.cross(first, second)], axis=1))
        visible = max(1 / self.aspect, self.angle if self.shape == "flat" else 0.0, 1e-6)
        largest = np.linalg.norm(mean) * rng.uniform(3, 10) / 60 * rng.choice([1.0, 0.1 / visible])
        small = largest / self.aspect
        scales = (small, largest, 0.7 * largest) if self.shape == "flat" else (largest, small, 0.7 * small)
        return gaussians(means=mean, scales=scales, quats=turn.as_quat(scalar_first=True), opacities=0.9)


class Agreement(NamedTuple):
    """Worst error of alpha against the reference, and its condition: the change of alpha by one rounding of the row."""

    error: float
    condition: float


def alphas(model: Gaussians, view: Camera, energy: Energy) -> tuple[np.ndarray, np.ndarray]:
    """Return alpha [H,W] of a model of one row, and the mask [H,W] where a rounding may decide whether it is 0."""
    projection = project(model, view, energy)
    energies, depths = projection.evaluate(0, *pixel_centres(view))
    unclamped = projection.opacities[0] * energies
    undecided = np.abs(unclamped / ALPHA_MIN - 1) < 1e-3
    undecided |= (energy == "ray") & (np.abs(depths / NEAR_PLANE - 1) < 1e-4)
    return np.where(unclamped >= ALPHA_MIN, np.minimum(unclamped, ALPHA_MAX), 0.0), undecided


def rounded_once_more(model: Gaussians, rng: np.random.Generator) -> Iterator[Gaussians]:
    """Yield the row with errors of about one float32 rounding in centre, rotation and scales."""
    mean, quat, scales = (part.astype(np.float64) for part in (model.means, model.quats, model.scales))
    for _ in range(ROUNDINGS):
        table = model.table.astype([(name, "<f8") for name in model.table.dtype.names or ()])
        moved = mean + ULP * np.linalg.norm(mean) * rng.uniform(-1, 1, mean.shape)
        turned = quat + ULP * np.linalg.norm(quat) * rng.uniform(-1, 1, quat.shape)
        log_scales = np.log(scales) + ULP * rng.uniform(-1, 1, scales.shape)
        names = ("x", "y", "z", *(f"rot_{i}" for i in range(4)), *(f"scale_{i}" for i in range(3)))
        for name, value in zip(names, np.concatenate([moved, turned, log_scales], axis=1).T, strict=True):
            table[name] = value
        yield Double(table)


class Double(Gaussians):
    """Gaussians in double precision."""

    def columns(self, *names: str) -> np.ndarray:
        """Return the named columns as one array [K, len(names)]."""
        return np.stack([self.table[name] for name in names], axis=1)


def agreement(model: Gaussians, view: Camera, energy: Energy, device: Device, style: Style, seed: int = 0) -> Agreement:
    """Compare a model of one row with the reference, at the pixels where no rounding decides whether it is drawn."""
    expected, undecided = alphas(model, view, energy)
    moved = [alphas(rounded, view, energy) for rounded in rounded_once_more(model, np.random.default_rng(seed))]
    condition = np.max([np.abs(alpha - expected) for alpha, _ in moved], axis=0)
    for _, undecided_after_moving in moved:
        undecided |= undecided_after_moving
    rendered = 1 - Renderer(model, device, energy=energy, style=style).transmittance(view)
    error = np.abs(rendered - expected)
    steady = ~undecided
    return Agreement(float(error[steady].max(initial=0.0)), float(condition[steady].max(initial=0.0)))


def worst(cell: Cell, device: Device, style: Style) -> Agreement:
    """Return the worst error of several Gaussians of a cell, and the worst condition."""
    rng = np.random.default_rng(1)
    agreements = [agreement(cell.gaussian(rng), VIEW, "ray", device, style) for _ in range(DRAWS)]
    return Agreement(
        error=max(draw.error for draw in agreements),
        condition=max(draw.condition for draw in agreements),
    )


def table(shape: Shape, device: Device) -> Iterator[str]:
    """Yield the lines of a Markdown table: worst error / worst condition of several draws of each cell."""
    yield f"| {shape}: aspect | depth | " + " | ".join(f"{angle:g} rad" for angle in ANGLES) + " |"
    yield "| --- " * (2 + len(ANGLES)) + "|"
    style = suited_style(device.cl_device)
    for aspect, depth in product(ASPECTS, DEPTHS):
        cells = [worst(Cell(shape, aspect, angle, depth), device, style) for angle in ANGLES]
        texts = (f"{cell.error:.0e} / {cell.condition:.0e}" if any(cell) else "–" for cell in cells)
        yield f"| {aspect:g} | {depth:g} | " + " | ".join(texts) + " |"


if __name__ == "__main__":
    for shape in SHAPES:
        print(*table(shape, choose_device()), "", sep="\n", flush=True)
