"""The strength of a mark: as much as a given damage to the training views allows."""

from typing import Final

import numpy as np

from gspure.arrays import Float64
from gspure.metrics.image_metrics import psnr
from gspure.model import Gaussians
from gspure.opencl.device import Device
from gspure.renderer import Renderer
from gspure.schemes.keyed_pattern.pattern import Grid, Pattern, marked
from gspure.schemes.pair import Capture

PROBE: Final = 0.01  # strength at which the effect on renders is measured, of colours 0 to 1; ours
STRONGEST: Final = 1.0
BISECTIONS: Final = 40
WEAKER: Final = 0.97  # factor on a strength that damages more than its linear effect says; ours


def strongest(
    clean: Gaussians, pattern: Pattern, capture: Capture, most_damage: float, device: Device | None = None
) -> Gaussians:
    """Return the model with the strongest mark whose damage, the drop of the mean PSNR in dB, is at most this."""
    grid = Grid.of(clean)
    costs = _costs(clean, marked(clean, grid, pattern, PROBE), capture, device)
    weak = 0.0
    strong = STRONGEST
    for _ in range(BISECTIONS):
        middle = (weak + strong) / 2
        errors = costs @ [1, middle, middle**2]
        damage = 10 * np.log10(errors / costs[:, 0]).mean()
        if damage <= most_damage:
            weak = middle
        else:
            strong = middle
    least_quality = _quality(clean, capture, device) - most_damage
    strength = weak
    model = marked(clean, grid, pattern, strength)
    while _quality(model, capture, device) < least_quality:
        strength *= WEAKER
        model = marked(clean, grid, pattern, strength)
    return model


def _costs(clean: Gaussians, probe: Gaussians, capture: Capture, device: Device | None) -> Float64:
    """Return the coefficients [V,3] of the mean squared error of each view as a polynomial of the strength."""
    before = Renderer(clean, device)
    after = Renderer(probe, device)
    rows = []
    for view, photograph in zip(capture.views, capture.images, strict=True):
        image = before.image(view).astype(np.float64)
        error = image - photograph
        effect = (after.image(view) - image) / PROBE
        rows.append([np.square(error).mean(), 2 * (error * effect).mean(), np.square(effect).mean()])
    return np.maximum(rows, [1e-12, -np.inf, 0])


def _quality(model: Gaussians, capture: Capture, device: Device | None) -> float:
    """Return the mean PSNR of the training views in dB."""
    renderer = Renderer(model, device)
    pairs = zip(capture.views, capture.images, strict=True)
    return float(np.mean([psnr(renderer.image(view).clip(0, 1), photograph) for view, photograph in pairs]))
