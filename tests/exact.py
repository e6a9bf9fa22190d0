"""Finite differences of the reference: a model's parameters in float64, so that small steps are not lost."""

from dataclasses import dataclass, fields, replace
from typing import Any, cast

import numpy as np

from gspure.arrays import Bools, Float64
from gspure.cameras import Camera
from gspure.model import Gaussians
from tests.reference.blending import Margins, render

GRADIENT_OF = {name: name for name in ("means", "quats", "scales", "opacities")} | {"sh_coeffs": "channels"}
"""Parameters of a model, and the names of their gradients."""

STEP = 1e-7


@dataclass(frozen=True)
class Exact:
    """Parameters as the reference reads them from a model."""

    means: np.ndarray
    quats: np.ndarray
    scales: np.ndarray
    opacities: np.ndarray
    sh_coeffs: np.ndarray

    @staticmethod
    def of(model: Gaussians) -> "Exact":
        return Exact(*(getattr(model, field.name).astype(np.float64) for field in fields(Exact)))

    def natural_direction(self, name: str, rng: np.random.Generator) -> Float64:
        """A random direction in which no parameter leaves its range soon."""
        sizes = {"scales": self.scales, "opacities": self.opacities * (1 - self.opacities)}
        direction = rng.normal(size=getattr(self, name).shape)
        return np.asarray(direction * sizes.get(name, 1.0))

    def slope(self, name: str, direction: Float64, view: Camera, image_gradient: np.ndarray, **settings: Any) -> float:
        """Derivative of (image . image_gradient) as parameter `name` moves along `direction`."""

        def rendered(step: float) -> Float64:
            moved = replace(self, **{name: getattr(self, name) + step * direction})
            return render(cast("Gaussians", moved), view, "ewa", **settings).channels

        return float(((rendered(STEP) - rendered(-STEP)) * image_gradient).sum() / (2 * STEP))


def smooth_pixels(margins: Margins, distance: float = 1e-3) -> Bools:
    """Pixels [H,W] so far from all steps and kinks that small changes of any parameter do not reach them."""
    nearest = np.minimum(np.minimum(margins.alpha, margins.stop), np.minimum(margins.clamp, 10 * margins.order))
    return nearest > distance
