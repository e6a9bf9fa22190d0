"""Agreement of every installed OpenCL driver, in both kernel styles, with the float64 reference.

``python -m experiments.drivers``, in a checkout, prints a Markdown table of the largest errors over several awkward
models: of the worst pixel, of the mean contribution, and of the worst centre's gradient, relative to it. Pixels where
rounding may flip a decision of blending (cut-off of alpha, stop, order) are left out. ``OCL_ICD_VENDORS`` may name a
folder with the .icd files of further drivers.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gspure.cameras import Camera
from gspure.model import Gaussians
from gspure.opencl.device import Device, list_devices, works
from gspure.opencl.engine import Style
from gspure.renderer import Renderer
from tests.comparison import may_flip, may_swap, steady_pixels
from tests.models import AWKWARD, blobs, tilted_camera
from tests.reference.blending import centre_contributions, render
from tests.reference.gradients import pull_back

NAMES = ("covering", "inside", "grazing", "flakes", "off_screen", "geographic")
CASES = [(blobs(200, 1), tilted_camera()), *(AWKWARD[name]() for name in NAMES)]

STEADY = 1e-3
"""Least margin of a centre from such a decision; closer ones are not compared."""


def errors(device: Device, style: Style) -> dict[str, float]:
    """Return the largest error of images, contributions and gradients over all cases."""
    images: list[float] = []
    contributions: list[float] = []
    gradients: list[float] = []
    for model, view in CASES:
        for energy in ("ewa", "ray"):
            expected = render(model, view, energy)
            renderer = Renderer(model, device, energy=energy, style=style)
            steady = ~(may_flip(expected.margins) | may_swap(expected.margins))
            error = np.abs(renderer.image(view) - expected.channels)[steady]
            images.append(error.max() / max(expected.channels.max(), 1.0))
            per_pixel = np.abs(_sums(renderer, view, len(model)) - expected.sums) / np.maximum(expected.pixels, 1)
            contributions.append(float(per_pixel[expected.pixels > 0].mean()))
        centres, margins = centre_contributions(model, view)
        renderer = Renderer(model, device, energy="center_ray", style=style)
        error = np.abs(_sums(renderer, view, len(model)) - centres)[margins > STEADY]
        contributions.append(float(error.mean()) if len(error) else 0.0)
        gradients.append(_gradient_error(model, view, device, style))
    return {"image": max(images), "contributions": max(contributions), "gradients": max(gradients)}


def _gradient_error(model: Gaussians, view: Camera, device: Device, style: Style) -> float:
    """Return the largest relative error of a row's gradient with respect to its centre."""
    gradient = np.random.default_rng(0).normal(size=(view.height, view.width, 3)).astype(np.float32)
    gradient *= steady_pixels(render(model, view, "ewa").margins)[..., None]
    expected = pull_back(model, view, gradient).means
    _, pullback = Renderer(model, device, style=style).vjp(view)
    error = np.linalg.norm(pullback(gradient).means - expected, axis=1)
    size = np.linalg.norm(expected, axis=1)
    return float(np.max(error / (size + 0.01 * np.sqrt((size**2).mean()) + 1e-12)))


def _sums(renderer: Renderer, view: Camera, count: int) -> NDArray[np.float64]:
    """Return the contribution of every row to a view."""
    contributions = renderer.contributions(view)
    sums = np.zeros(count)
    sums[contributions["index"]] = contributions["sum"]
    return sums


def rows() -> Iterator[dict[str, str]]:
    """Yield a row for every driver and kernel style: its errors as text."""
    for device in filter(works, list_devices()):
        for style in ("cpu", "gpu"):
            texts = {name: f"{value:.1e}" for name, value in errors(device, style).items()}
            yield {"driver": f"{device.platform} {device.driver}", "style": style, **texts}


if __name__ == "__main__":
    print(
        "| driver | kernel style | image, worst pixel | contributions per pixel, mean of rows | gradients, worst row |"
    )
    print("| --- | --- | --- | --- | --- |")
    for row in rows():
        print(f"| {' | '.join(row.values())} |", flush=True)
