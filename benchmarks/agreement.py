"""Tables of docs/numerics.md: how well this machine's device agrees with the float64 reference on extreme Gaussians.

``python -m benchmarks.agreement``, in a checkout.
"""

from collections.abc import Iterator
from itertools import product

import numpy as np

from gspure.opencl.device import Device, choose_device
from gspure.opencl.engine import Style, suited_style
from tests.agreement import SHAPES, VIEW, Agreement, Cell, Shape, agreement

ASPECTS = (1.0, 1e2, 1e4, 1e6, 1e8)
ANGLES = (1.0, 1e-2, 1e-4, 1e-6, 0.0)
DEPTHS = (0.201, 1.0, 10.0, 1e3)
DRAWS = 12


def worst(cell: Cell, device: Device, style: Style) -> Agreement:
    """Return the worst error of several Gaussians of a cell, and the worst condition."""
    rng = np.random.default_rng(1)
    found = [agreement(cell.gaussian(rng), VIEW, "ray", device, style) for _ in range(DRAWS)]
    return Agreement(*(max(values) for values in zip(*found, strict=True)))


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
