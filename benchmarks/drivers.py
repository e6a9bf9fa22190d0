"""Agreement of every OpenCL driver at hand, in both kernel styles, with the float64 reference.

``python -m benchmarks.drivers``, in a checkout, prints a Markdown table of errors over pixels away from every step of
the rules, the worst of several awkward models. ``OCL_ICD_VENDORS`` may name a folder with the .icd files of further
drivers.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gspure.cameras import Camera
from gspure.opencl.device import Device, list_devices, works
from gspure.opencl.engine import Style
from gspure.renderer import Renderer
from tests.comparison import may_flip, may_swap, steady_pixels
from tests.models import AWKWARD, blobs, tilted_camera
from tests.reference.blending import centre_contributions, render
from tests.reference.gradients import pull_back

CASES = {"blobs": lambda: (blobs(200, 1), tilted_camera())} | {
    name: AWKWARD[name] for name in ("covering", "inside", "grazing", "flakes", "off_screen", "stacked", "geographic")
}

STEADY = 1e-3
"""Centres that are nearer to a step of the rules than this may be blended otherwise in float32."""


def errors(device: Device, style: Style) -> dict[str, float]:
    """Return the largest error of each product over all cases."""
    found: dict[str, list[float]] = {"image": [], "contributions": [], "gradients": []}
    for case in CASES.values():
        model, view = case()
        for energy in ("ewa", "ray"):
            expected, renderer = render(model, view, energy), Renderer(model, device, energy=energy, style=style)
            steady = ~(may_flip(expected.margins) | may_swap(expected.margins))
            error = np.abs(renderer.image(view) - expected.channels)[steady]
            found["image"].append(error.max() / max(expected.channels.max(), 1.0))
            whole = np.abs(_sums(renderer, view, len(model)) - expected.sums) / np.maximum(expected.pixels, 1)
            found["contributions"].append(float(whole[expected.pixels > 0].mean()))
        centres, margins = centre_contributions(model, view)
        renderer = Renderer(model, device, energy="center_ray", style=style)
        error = np.abs(_sums(renderer, view, len(model)) - centres)[margins > STEADY]
        found["contributions"].append(float(error.mean()) if len(error) else 0.0)
        gradient = np.random.default_rng(0).normal(size=(view.height, view.width, 3)).astype(np.float32)
        expected = render(model, view, "ewa")
        gradient *= steady_pixels(expected.margins)[..., None]
        true = pull_back(model, view, gradient).means
        error = np.linalg.norm(Renderer(model, device, style=style).vjp(view)[1](gradient).means - true, axis=1)
        size = np.linalg.norm(true, axis=1)
        found["gradients"].append(float(np.max(error / (size + 0.01 * np.sqrt((size**2).mean()) + 1e-12))))
    return {name: max(values) for name, values in found.items()}


def _sums(renderer: Renderer, view: Camera, count: int) -> NDArray[np.float64]:
    """Return the contribution of every row to a view."""
    contributions, sums = renderer.contributions(view), np.zeros(count)
    sums[contributions["index"]] = contributions["sum"]
    return sums


def rows() -> Iterator[dict[str, str]]:
    """Yield a row for every driver and kernel style: its errors as text."""
    for device in filter(works, list_devices()):
        for style in ("cpu", "gpu"):
            found = {name: f"{value:.1e}" for name, value in errors(device, style).items()}
            yield {"driver": f"{device.platform} {device.driver}", "style": style, **found}


if __name__ == "__main__":
    print(
        "| driver | kernel style | image, worst pixel | contributions per pixel, mean of rows | gradients, worst row |"
    )
    print("| --- | --- | --- | --- | --- |")
    for row in rows():
        print(f"| {' | '.join(row.values())} |", flush=True)
