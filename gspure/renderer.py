"""The only entry to the device: images, feature maps, contributions and depths of a model's views."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial, wraps
from typing import Any, Concatenate, Final, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32
from gspure.cameras.camera import Camera
from gspure.constants import ENERGIES, GEOMETRY_ATTRIBUTES, Energy
from gspure.errors import InputError, refuse_path
from gspure.model.finite import filtered
from gspure.model.gaussians import Gaussians
from gspure.opencl.device import Device, choose_device
from gspure.opencl.engine import Engine, Style
from gspure.opencl.frame import Frame, Traversal
from gspure.opencl.gradients import by_row
from gspure.opencl.opacity_field import PointRays
from gspure.opencl.passes import ENTRY_BUDGET, Rendered, backward, forward, require_conservation
from gspure.opencl.storage import positions_of, store, upload_attributes, upload_sh_coeffs

BLACK: Final = (0.0, 0.0, 0.0)
WHITE: Final = (1.0, 1.0, 1.0)
CONTRIBUTION = np.dtype([("index", "<u4"), ("sum", "<f4"), ("max", "<f4"), ("pixels", "<u4")])
"""A touched Gaussian of a view: its row, the sum and maximum of alpha T over pixels, the number of pixels."""


@dataclass(frozen=True)
class Gradients:
    """Gradients of a loss with respect to the inputs of an image, by row.

    Parameters
    ----------
    means, quats, scales : arrays [K,3], [K,4], [K,3]
        `quats` as stored (not normalized), `scales` > 0.
    opacities : array [K]
        In (0, 1).
    channels : array [K,S,3] or [K,C]
        Of the SH coefficients, or of the features.
    means2d : array [K,2]
        Of the projected centres, per pixel; for densification.

    """

    means: Float32
    quats: Float32
    scales: Float32
    opacities: Float32
    channels: Float32
    means2d: Float32


Pullback = Callable[[Float32], Gradients]

Arguments = ParamSpec("Arguments")
Product = TypeVar("Product")
Method = Callable[Concatenate["Renderer", Arguments], Product]


def _exclusive(method: Method[Arguments, Product]) -> Method[Arguments, Product]:
    """Let one thread at a time run the exclusive methods of a renderer."""

    @wraps(method)
    def alone(self: Renderer, /, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Product:
        with self._engine.exclusive():
            return method(self, *args, **kwargs)

    return alone


class Renderer:
    """Renders views of one model on one OpenCL device.

    Gaussians are blended front to back by (view depth of the centre, row), with the rules of `gspure.constants`. Every
    result is the same to the last bit from run to run, for any number of threads of the device and any memory
    budget. Python threads that share a renderer take turns; a process forked after its first use is refused.

    Parameters
    ----------
    model : Gaussians
        K Gaussians, with the 3-D filter that their file may hold; uploaded once.
    device : Device, optional
        By default the one that `gspure.opencl.device.choose_device` picks.
    energy : "ewa", "ray" or "center_ray"
        Fall-off of a Gaussian: a 2-D splat with dilation, as in the training of vanilla models, or its maximum along
        the pixel's ray (paper, Eq. E). "center_ray" is "ray" with contributions on one ray per Gaussian instead of one
        per pixel.
    style : "cpu" or "gpu", optional
        Kernel style; by default the one that suits the device.
    entry_budget : int
        Most tile entries held at a time.

    Examples
    --------
    >>> renderer = gspure.Renderer(model)
    >>> renderer.image(cameras[0]).shape, renderer.depth(cameras[0]).shape
    ((36, 48, 3), (36, 48))

    """

    def __init__(
        self,
        model: Gaussians,
        device: Device | None = None,
        *,
        energy: Energy = "ewa",
        style: Style | None = None,
        entry_budget: int = ENTRY_BUDGET,
    ) -> None:
        if energy not in ENERGIES:
            raise ValueError(f"the energy is one of {', '.join(ENERGIES)}, not {energy!r}")
        refuse_path("Renderer", "model", model, expected="Gaussians", hint="gspure.read_model reads a file")
        self.model = model
        self.energy: Energy = energy
        self._entry_budget = entry_budget
        self._engine = Engine((device or choose_device()).cl_device, style)
        self._storage = store(self._engine, filtered(model))
        self._last: Rendered | None = None

    @_exclusive
    def image(self, camera: Camera, background: Sequence[float] = BLACK) -> Float32:
        """Return the colour image [H,W,3]: non-negative, not clipped above.

        The background is black by default; commands use `Gaussians.background` of the model.

        Raise `InputError` if the model holds no colour (no ``f_dc`` columns).
        """
        traversal, channels = self._channels(None)
        last = self._last  # `gspure.attacks.strength` renders each view on black and on white, for what a model covers
        if last is not None and last.is_on_black(camera, traversal) and tuple(background) == WHITE:
            return last.image_on_white()
        return self._render(camera, traversal, channels, background).image()

    @_exclusive
    def feature_map(self, camera: Camera, features: Float32, background: Sequence[float] | None = None) -> Float32:
        """Return the blended `features` [K,C] of a view: [H,W,C]. `background` [C] is zero by default."""
        return self._render(camera, *self._channels(features), background).image()

    @_exclusive
    def contributions(self, camera: Camera) -> NDArray[np.void]:
        """Return omega_{k,v} (paper, Eq. for omega) of each touched Gaussian, as `CONTRIBUTION`.

        Rows are ordered by index, without Gaussians that touch no pixel. With the energy "center_ray", each has one
        pixel: the ray through its centre.

        Raise `InputError` if the results of the device do not conserve light (`gspure.opencl.passes`).
        """
        if self.energy == "center_ray":
            return self._centre_contributions(camera)
        canvas = self._render(camera, Traversal(self.energy, contributions=True)).canvas
        with self._engine.mapped(canvas.records, (len(self.model),), CONTRIBUTION) as records:
            # numpy selects 16-byte numbers several times faster than 16-byte structures.
            touched = records.view(np.complex128).compress(records["pixels"] > 0).view(CONTRIBUTION)
        with self._engine.mapped(canvas.transmittance, (camera.height, camera.width), np.float32) as transmittance:
            require_conservation(camera.name, touched, transmittance)
        return touched

    def _point_rays(self, camera: Camera) -> PointRays:
        self._last = None  # its buffers are used again
        return PointRays(self._engine, self._storage, camera, self._entry_budget)

    def _centre_contributions(self, camera: Camera) -> NDArray[np.void]:
        positions = positions_of(self._storage.order)
        shares = self._point_rays(camera).contributions(self.model.means, positions)
        rows = np.flatnonzero(shares)
        touched = np.ones(len(rows), CONTRIBUTION)
        touched["index"] = rows
        touched["sum"] = shares[rows]
        touched["max"] = shares[rows]
        return touched

    @_exclusive
    def transmittance(self, camera: Camera) -> Float32:
        """Return the transmittance [H,W], the background's share of each pixel, 0 to 1."""
        canvas = self._render(camera, Traversal(self.energy)).canvas
        return self._engine.read(canvas.transmittance, (camera.height, camera.width), np.float32)

    @_exclusive
    def depth(self, camera: Camera) -> Float32:
        """Return the median depth [H,W] along the view axis; infinite where half the light passes."""
        canvas = self._render(camera, Traversal(self.energy, median_depth=True)).canvas
        return self._engine.read(canvas.median_depth, (camera.height, camera.width), np.float32)

    @_exclusive
    def rays(self, camera: Camera) -> PointRays:
        """Return a view prepared for `opacities_at`; usable until the renderer's next image."""
        if self.energy != "ray":
            raise ValueError("opacities of points exist for the energy 'ray'")
        return self._point_rays(camera)

    @_exclusive
    def opacities_at(self, camera: Camera, points: NDArray[np.floating[Any]]) -> Float32:
        """Return the opacity [P] that a view's rays have met at each of the world `points` [P,3] (GOF).

        A Gaussian counts with its energy "ray" up to the point: the maximum if that lies before the point, otherwise
        the value at the point. The opacity is 1 if the view does not show the point. Raise ValueError for another
        energy.
        """
        return self.rays(camera).opacities(points)

    @_exclusive
    def vjp(
        self, camera: Camera, features: Float32 | None = None, background: Sequence[float] | None = None
    ) -> tuple[Float32, Pullback]:
        """Return an image and its pullback (vector-Jacobian product).

        Parameters
        ----------
        features : array [K,C], optional
            Blend these instead of the SH colours.
        background : sequence of C floats, optional
            Zero by default.

        Returns
        -------
        image : array [H,W,C]
        pullback : callable
            Takes dL/dimage [H,W,C], finite, and returns `Gradients`. Usable until the renderer's next image.

        Raises
        ------
        ValueError
            If the renderer's energy is not "ewa", or `features` and the model differ in their numbers of rows.
        InputError
            If neither `features` nor the model's colour exist.

        """
        if self.energy != "ewa":
            raise ValueError("gradients exist for the energy that models are trained with, 'ewa'")
        rendered = self._render(camera, *self._channels(features), background)

        return rendered.image(), partial(self._pull_back, rendered)

    @_exclusive
    def _pull_back(self, rendered: Rendered, image_gradient: Float32) -> Gradients:
        if self._last is not rendered:
            raise RuntimeError("the renderer has made another image since; call vjp again")
        if image_gradient.shape != rendered.shape:
            raise ValueError(f"the gradient is {image_gradient.shape}, the image {rendered.shape}")
        image_gradient = np.asarray(image_gradient, np.float32)
        if not np.isfinite(image_gradient).all():  # kernels would leave out its pixels
            raise InputError("vjp", "image_gradient", expected="finite numbers", found="infinity or not-a-number")
        engine = self._engine
        storage = self._storage
        traversal = rendered.frame.traversal
        gradients = backward(rendered, engine.buffers.image_gradient.holding(image_gradient))
        geometry = by_row(engine, storage, gradients.geometry, GEOMETRY_ATTRIBUTES)
        channels = by_row(engine, storage, gradients.channels, traversal.channel_attributes)
        if traversal.sh_degree >= 0:
            channels = channels.reshape(-1, channels.shape[1] // 3, 3)
        return Gradients(
            means=geometry[:, 0:3],
            quats=geometry[:, 3:7],
            scales=geometry[:, 7:10],
            opacities=geometry[:, 10],
            channels=channels,
            means2d=by_row(engine, storage, gradients.centres, 2),
        )

    def _channels(self, features: Float32 | None) -> tuple[Traversal, object]:
        """Return a traversal and its channels on the device: `features`, or the model's colours if they are None."""
        if features is None:
            if self.model.sh_degree < 0:
                raise InputError("model", "f_dc_0", expected="spherical-harmonic colour", found="none")
            return Traversal(self.energy, channels=3, sh_degree=self.model.sh_degree), self._sh_coeffs
        count, channels = features.shape
        if count != len(self.model):
            raise ValueError(f"features are of {count} Gaussians, the model has {len(self.model)}")
        stored = upload_attributes(self._engine, self._storage.order, channels, features.__getitem__)
        return Traversal(self.energy, channels=channels), stored

    @cached_property
    def _sh_coeffs(self) -> object:
        return upload_sh_coeffs(self._engine, self._storage, self.model)

    def _render(
        self,
        camera: Camera,
        traversal: Traversal,
        channels: object | None = None,
        background: Sequence[float] | None = None,
    ) -> Rendered:
        """Render a frame; its background is zero by default."""
        background = [0.0] * max(traversal.channels, 1) if background is None else background
        frame = Frame(self._engine, self._storage, camera, traversal, channels)
        self._last = forward(frame, background, self._entry_budget)
        return self._last
