"""Finite differences of the reference: a model's parameters in float64, so that small steps are not lost."""

from dataclasses import dataclass, fields, replace

import numpy as np

from tests.reference.blending import render

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
    def of(model):
        return Exact(*(getattr(model, field.name).astype(np.float64) for field in fields(Exact)))

    def natural_direction(self, name, rng):
        """A random direction in which no parameter leaves its range soon."""
        sizes = {"scales": self.scales, "opacities": self.opacities * (1 - self.opacities)}
        return rng.normal(size=getattr(self, name).shape) * sizes.get(name, 1.0)

    def slope(self, name, direction, view, image_gradient, **settings):
        """Derivative of (image . image_gradient) as parameter `name` moves along `direction`."""
        ahead, back = (
            render(replace(self, **{name: getattr(self, name) + step * direction}), view, "ewa", **settings).channels
            for step in (STEP, -STEP)
        )
        return ((ahead - back) * image_gradient).sum() / (2 * STEP)


def smooth_pixels(margins, distance=1e-3):
    """Pixels [H,W] so far from all steps and kinks that small changes of any parameter do not reach them."""
    nearest = np.minimum(np.minimum(margins.alpha, margins.stop), np.minimum(margins.clamp, 10 * margins.order))
    return nearest > distance
