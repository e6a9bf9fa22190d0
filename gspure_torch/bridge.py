"""The renderer as a differentiable function of PyTorch tensors, for training networks together with Gaussians.

>>> from gspure_torch.bridge import TorchRenderer  # doctest: +SKIP
>>> render = TorchRenderer()  # doctest: +SKIP
>>> features = torch.zeros(len(means), 16, requires_grad=True)  # doctest: +SKIP
>>> feature_map = render(camera, means, quats, scales, opacities, features)  # doctest: +SKIP
>>> loss(decoder(feature_map.permute(2, 0, 1))).backward()  # doctest: +SKIP

"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gspure.arrays import Float32, Int32, UInt32
from gspure.cameras.camera import Camera
from gspure.constants import GEOMETRY_ATTRIBUTES
from gspure.opencl.device import Device, choose_device
from gspure.opencl.engine import Engine, Style
from gspure.opencl.frame import Frame, Traversal
from gspure.opencl.gradients import by_row, covariance_gradients
from gspure.opencl.passes import backward, forward
from gspure.opencl.projection import splat_radii
from gspure.opencl.storage import Storage, upload_tables
from gspure_torch.pytorch import on_host, torch

_BANDS = (1, 4, 9, 16)  # spherical-harmonic coefficients per colour, of degrees 0 to 3


class BlendInputs(NamedTuple):
    """The tensors of an image, float32, as `TorchRenderer` takes them; `channels` are features or SH coefficients.

    If `background` has four or five values for SH coefficients, the fourth channel of the image is the inverse depth,
    and the fifth is what the Gaussians cover.
    `means2d` [K,2] and `covs2d` [K,3] are not read. They receive the gradients of the projected centres, in pixels, and
    of the covariances on the image plane, xx, xy and yy in square pixels.
    """

    background: torch.Tensor
    means: torch.Tensor
    quats: torch.Tensor
    scales: torch.Tensor
    opacities: torch.Tensor
    channels: torch.Tensor
    means2d: torch.Tensor | None = None
    covs2d: torch.Tensor | None = None


_GEOMETRY = {"means": range(3), "quats": range(3, 7), "scales": range(7, 10), "opacities": range(10, 11)}
_READ = 6  # of these tensors; the others only receive gradients


class TorchRenderer:
    """A renderer of Gaussians in tensors; gradients flow back to all of them.

    Images and gradients are bit-identical to those of `gspure.renderer.Renderer` with energy "ewa". Tensors are float32
    on any device and are uploaded for each image.

    Any number of images may be rendered before ``backward()``, in any order. The device holds only the last one; the
    backward pass renders any earlier one again.

    By default, the device is that of `gspure.opencl.device.choose_device`, and the kernel style suits it.
    """

    def __init__(self, device: Device | None = None, style: Style | None = None) -> None:
        self._frames = _Frames(Engine((device or choose_device()).cl_device, style))

    def __call__(
        self,
        camera: Camera,
        means: torch.Tensor,
        quats: torch.Tensor,
        scales: torch.Tensor,
        opacities: torch.Tensor,
        features: torch.Tensor | None = None,
        sh_coeffs: torch.Tensor | None = None,
        background: torch.Tensor | Sequence[float] | None = None,
    ) -> torch.Tensor:
        """Return an image [H,W,C] of blended features, or of spherical-harmonic colours (C = 3, not clipped above).

        Parameters
        ----------
        means, quats, scales, opacities : tensors [K,3], [K,4], [K,3], [K]
            Activated, as `gspure.model.Gaussians` has them: world units; quaternions (w, x, y, z) of any norm;
            `scales` > 0; `opacities` in (0, 1). To optimize logarithms and logits, as 3DGS does, pass their ``exp()``
            and ``sigmoid()``.
        features, sh_coeffs : tensors [K,C] or [K,S,3], S = 1, 4, 9 or 16
            One of the two.
        background : tensor or sequence of C floats, optional
            Zero by default.

        Raises
        ------
        TypeError
            A tensor is not float32.
        ValueError
            A tensor has another shape, or not exactly one of `features` and `sh_coeffs` is given.

        """
        if (features is None) == (sh_coeffs is None):
            raise ValueError("give either features or sh_coeffs")
        count = len(means)
        if features is not None:
            channels = features
            width = features.shape[-1]
            _require("features", features, (count, width))
        else:
            channels = sh_coeffs
            width = 3
            _require("sh_coeffs", channels, *((count, bands, 3) for bands in _BANDS))
        colour = torch.zeros(width) if background is None else torch.as_tensor(background, dtype=torch.float32)
        _require("background", colour, (width,))
        _require("means", means, (count, 3))
        _require("quats", quats, (count, 4))
        _require("scales", scales, (count, 3))
        _require("opacities", opacities, (count,))
        return self.blend(camera, BlendInputs(colour, means, quats, scales, opacities, channels))

    def radii(self, camera: Camera, *geometry: torch.Tensor, per_axis: bool = False) -> torch.Tensor:
        """Return the radii of Gaussians in a view, int32, in pixels; 0 for those that it does not show.

        They are those [K] of 3DGS or, `per_axis`, those [K,2] of gsplat. `geometry` are means, quaternions, scales and
        opacities.
        """
        radii = self._frames.radii(camera, *map(on_host, geometry), per_axis=per_axis)
        return torch.from_numpy(radii).to(geometry[0].device)

    def radii_of_last(self, *, per_axis: bool = False) -> torch.Tensor:
        """Return the radii of the Gaussians of the last image, on the CPU."""
        return torch.from_numpy(self._frames.radii_of_last(per_axis=per_axis))

    def blend(self, camera: Camera, inputs: BlendInputs) -> torch.Tensor:
        """Return the image [H,W,C] of tensors whose shapes and types are right."""
        image: torch.Tensor = _Image.apply(self._frames, camera, *inputs)
        return image


class _Frames:
    """Frames on the device, by number; only the last one can be read and differentiated."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._order: UInt32 = np.zeros(0, np.uint32)
        self.last = 0

    def draw(self, camera: Camera, *arrays: Float32) -> int:
        """Render the first six of `BlendInputs`, and return the frame's number."""
        background, means, quats, scales, opacities, channels = arrays
        self.last += 1
        engine = self._engine
        sh_degree = _BANDS.index(channels.shape[1]) if channels.ndim == 3 else -1
        traversal = Traversal("ewa", channels=len(background), sh_degree=sh_degree)
        storage = self._stored(means, quats, scales, opacities)
        table = channels.reshape(len(channels), traversal.channel_attributes)
        attributes = upload_tables(engine, [table], engine.buffers.channels)
        self.rendered = forward(Frame(engine, storage, camera, traversal, attributes), background.tolist())
        return self.last

    def radii(self, camera: Camera, *geometry: Float32, per_axis: bool) -> Int32:
        """Return the radii of splats, as `splat_radii` has them; no frame can be differentiated then."""
        self.last += 1
        return splat_radii(self._engine, self._stored(*geometry), camera, per_axis=per_axis)

    def radii_of_last(self, *, per_axis: bool) -> Int32:
        """Return the radii of the splats of the last frame."""
        frame = self.rendered.frame
        return splat_radii(frame.engine, frame.storage, frame.camera, per_axis=per_axis)

    def _stored(self, means: Float32, quats: Float32, scales: Float32, opacities: Float32) -> Storage:
        """Upload the geometry in the order of its rows: another one would save less than it costs in every frame."""
        engine = self._engine
        if len(means) != len(self._order):
            self._order = np.arange(len(means), dtype=np.uint32)
            self._rows = engine.uploaded(self._order)
        geometry = upload_tables(engine, [means, quats, scales, opacities[:, None]], engine.buffers.geometry)
        return Storage(self._order, self._rows, geometry, self._rows)

    def pull_back(self, image_gradient: Float32, requested: Sequence[bool]) -> list[Float32 | None]:
        """Return the `requested` gradients of the last frame, in the order of `BlendInputs`; the others may be None."""
        engine = self._engine
        rendered = self.rendered
        storage = rendered.frame.storage
        wanted = {name for name, is_wanted in zip(BlendInputs._fields, requested, strict=True) if is_wanted}
        gradients: dict[str, Float32] = {}
        by_splat = backward(rendered, engine.buffers.image_gradient.holding(image_gradient))
        if "background" in wanted:
            transmittance = engine.read(rendered.canvas.transmittance, image_gradient.shape[:2], np.float32)
            background_gradient = np.einsum("hw,hwc->c", transmittance, image_gradient, dtype=np.float64)
            gradients["background"] = background_gradient.astype(np.float32)
        for name, part in _GEOMETRY.items():
            if name in wanted:
                gradients[name] = by_row(engine, storage, by_splat.geometry, GEOMETRY_ATTRIBUTES, part)
        if "channels" in wanted:
            channel_attributes = rendered.frame.traversal.channel_attributes
            gradients["channels"] = by_row(engine, storage, by_splat.channels, channel_attributes)
        if "means2d" in wanted:
            gradients["means2d"] = by_row(engine, storage, by_splat.centres, 2)
        if "covs2d" in wanted:
            gradients["covs2d"] = covariance_gradients(rendered.frame, rendered.projected)
        return [gradients.get(name) for name in BlendInputs._fields]


class _Image(torch.autograd.Function):  # type: ignore[misc]
    """An image as autograd sees it: a function of `BlendInputs`."""

    @staticmethod
    def forward(ctx: Any, frames: _Frames, camera: Camera, *tensors: torch.Tensor) -> torch.Tensor:
        ctx.save_for_backward(*tensors)
        ctx.frames = frames
        ctx.camera = camera
        ctx.number = frames.draw(camera, *_read(tensors))
        return torch.from_numpy(frames.rendered.image()).to(tensors[1].device)

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
    def backward(ctx: Any, image_gradient: torch.Tensor) -> tuple[torch.Tensor | None, ...]:
        tensors = ctx.saved_tensors  # raises an error if they were changed since
        if ctx.frames.last != ctx.number:
            ctx.number = ctx.frames.draw(ctx.camera, *_read(tensors))
        gradients = ctx.frames.pull_back(on_host(image_gradient), ctx.needs_input_grad[2:])
        pairs = zip(gradients, tensors, strict=True)
        return (None, None, *(_placed(gradient, tensor) for gradient, tensor in pairs))


def _read(tensors: Sequence[torch.Tensor]) -> list[Float32]:
    """Return the arrays of the tensors that an image depends on."""
    return [on_host(tensor) for tensor in tensors[:_READ]]


def _placed(gradient: Float32 | None, tensor: torch.Tensor) -> torch.Tensor | None:
    """Return the gradient of a tensor, in its shape and on its device; None if none was requested."""
    if gradient is None:
        return None
    return torch.from_numpy(gradient).reshape(tensor.shape).to(tensor.device)


def _require(name: str, tensor: torch.Tensor, *shapes: tuple[int, ...]) -> None:
    """Refuse a tensor of another type or none of these shapes."""
    if tensor.dtype != torch.float32:
        raise TypeError(f"{name}: expected float32, found {tensor.dtype}")
    if tuple(tensor.shape) not in shapes:
        raise ValueError(f"{name}: expected shape {' or '.join(map(str, shapes))}, found {tuple(tensor.shape)}")
