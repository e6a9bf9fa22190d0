"""The function `rasterization` of gsplat."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, Final

import numpy as np

from gspure.cameras.camera import Camera
from gspure.constants import EWA_DILATION, NEAR_PLANE
from gspure_torch.bridge import BlendInputs
from gspure_torch.cuda_free.projection import antialiasing, image_covariances, seen_from, world_covariances
from gspure_torch.cuda_free.rasterizer import renderer
from gspure_torch.pytorch import on_host, torch

_FAR: Final = 1e10
_NAMES: Final = ("means", "quats", "scales", "opacities", "colors", "viewmats", "Ks", "width", "height")
_DEFAULTS: Final = {
    "near_plane": 0.01,
    "far_plane": _FAR,
    "radius_clip": 0.0,
    "eps2d": EWA_DILATION,
    "sh_degree": None,
    "packed": True,
    "tile_size": 16,
    "backgrounds": None,
    "render_mode": "RGB",
    "sparse_grad": False,
    "absgrad": False,
    "rasterize_mode": "classic",
    "channel_chunk": 32,
    "distributed": False,
    "camera_model": "pinhole",
}
"""The optional arguments, in the order of gsplat, and their defaults."""
_FIXED: Final = ("radius_clip", "eps2d", "absgrad", "distributed", "camera_model")
"""Those that can have no other value."""
_WITHOUT_EFFECT: Final = {"segmented", "global_z_order", "rolling_shutter", "covars"}
"""Further arguments: how gsplat computes, or what matters only with others that are refused."""
_MODES: Final = ("RGB", "D", "ED", "RGB+D", "RGB+ED")
_NEAREST: Final = 1e-3  # near plane
_LEAST_COVER: Final = 1e-10  # by which expected depths are divided
_BEHIND: Final = 2  # channels behind colours: the inverse depth, and the cover


def rasterization(
    has_radii_per_axis: bool,  # noqa: FBT001 -- before the arguments of gsplat
    /,
    *arguments: Any,
    **named: Any,
) -> tuple[torch.Tensor, torch.Tensor, dict[str, Any]]:
    """Return images [C,H,W,D] of C views, what Gaussians cover of them [C,H,W,1], and gsplat's further tensors.

    The radii among these are numbers or, `has_radii_per_axis`, pairs of them, as gsplat has them since 1.5.

    Raise ValueError for an argument, or a value of it, that gspure does not have.
    """
    values = _bound(arguments, named)
    views = [_View(values, number) for number in range(len(values["viewmats"]))]
    further = _further(values, views, has_radii_per_axis=has_radii_per_axis)
    centres = further["means2d"]
    if values["packed"]:
        rows = (further["camera_ids"], further["gaussian_ids"])
        centres = torch.zeros(len(views), len(values["means"]), 2, device=centres.device).index_put(rows, centres)
    images, covers = zip(*(view.drawn(centres[number]) for number, view in enumerate(views)), strict=True)
    return torch.stack(images), torch.stack(covers), further


def _further(values: Mapping[str, Any], views: Sequence[_View], *, has_radii_per_axis: bool) -> dict[str, Any]:
    """Return what gsplat returns beside images: sizes and, by view and Gaussian, radii, centres, depths and opacities.

    If `packed`, only Gaussians that a view shows are listed. The centres in pixels only receive gradients.
    """
    radii = torch.stack([view.radii(per_axis=has_radii_per_axis) for view in views])
    tensors = {
        "radii": radii,
        "means2d": torch.stack([view.centres() for view in views]),
        "depths": torch.stack([view.seen[2] for view in views]),
        "opacities": torch.stack([view.opacities for view in views]),
    }
    ids: dict[str, torch.Tensor | None] = {"camera_ids": None, "gaussian_ids": None}
    if values["packed"]:
        is_shown = radii.flatten(2).amin(2) > 0 if radii.ndim == 3 else radii > 0
        ids = dict(zip(ids, is_shown.nonzero(as_tuple=True), strict=True))
        tensors = {name: tensor[is_shown] for name, tensor in tensors.items()}
    tensors["means2d"].requires_grad_(values["means"].requires_grad and torch.is_grad_enabled())
    sizes = {name: values[name] for name in ("width", "height", "tile_size")}
    return {**ids, **tensors, **sizes, "n_cameras": len(views), "n_batches": 1}


def _bound(arguments: Sequence[Any], named: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of a call by name."""
    values = _DEFAULTS | dict(zip((*_NAMES, *_DEFAULTS), arguments, strict=False)) | dict(named)
    for name, value in values.items():
        is_known = name in _NAMES or name in _DEFAULTS
        if name in _FIXED and value != _DEFAULTS[name]:
            raise ValueError(
                f"gspure cuda-free: gsplat.rasterization has {name}={_DEFAULTS[name]!r} only, not {value!r}"
            )
        if not is_known and name not in _WITHOUT_EFFECT and value is not None and value is not False:
            raise ValueError(f"gspure cuda-free: gsplat.rasterization takes no {name}")
    if values.get("covars") is not None:
        raise ValueError("gspure cuda-free: gsplat.rasterization takes no covars, but quats and scales")
    if values["render_mode"] not in _MODES:
        raise ValueError(f"gspure cuda-free: render_mode is one of {', '.join(_MODES)}, not {values['render_mode']}")
    for name in ("viewmats", "Ks"):
        if values[name].requires_grad and torch.is_grad_enabled():
            raise ValueError(f"gspure cuda-free: gsplat.rasterization has no gradient of {name}")
    return values


class _View:
    """One of the views of a call."""

    def __init__(self, values: Mapping[str, Any], number: int) -> None:
        self._values = values
        self._number = number
        viewmat = on_host(values["viewmats"][number]).astype(np.float64)
        viewmat[3] = [0, 0, 0, 1]
        K = on_host(values["Ks"][number]).astype(np.float64)
        self._camera = Camera("view", int(values["width"]), int(values["height"]), K, viewmat)
        # In a world of another size, the near plane of gspure is that of the call.
        self._factor = NEAR_PLANE / max(values["near_plane"], _NEAREST)
        self._near = self._camera.moved(np.diag([*3 * [self._factor], 1.0]))

    @cached_property
    def seen(self) -> torch.Tensor:
        """The means in the axes of the camera, [3,K]."""
        return seen_from(self._camera, self._values["means"])

    @cached_property
    def opacities(self) -> torch.Tensor:
        """The opacities [K] in this view."""
        values = self._values
        opacities = values["opacities"]
        if values["rasterize_mode"] == "antialiased":
            covariances = world_covariances(values["quats"], values["scales"])
            opacities = opacities * antialiasing(image_covariances(self._camera, values["means"], covariances))
        if values["far_plane"] < _FAR:
            opacities = opacities.where(self.seen[2] < values["far_plane"], 0)
        return opacities

    @property
    def _geometry(self) -> tuple[torch.Tensor, ...]:
        """Means, quaternions, scales and opacities as the renderer takes them."""
        values = self._values
        factor = self._factor
        tensors = (values["means"] * factor, values["quats"], values["scales"] * factor, self.opacities)
        return tuple(tensor.float() for tensor in tensors)

    def radii(self, *, per_axis: bool) -> torch.Tensor:
        """Return the radii, [K] or, `per_axis`, [K,2]."""
        return renderer().radii(self._near, *self._geometry, per_axis=per_axis)

    def centres(self) -> torch.Tensor:
        """Return the projected centres [K,2] in pixels."""
        fx, fy, cx, cy = self._camera.numbers[2:6].tolist()
        x, y, z = self.seen.detach()
        return torch.stack([fx * x / z + cx, fy * y / z + cy], dim=1)

    def drawn(self, centres: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the image [H,W,D], and what Gaussians cover of it [H,W,1]; `centres` [K,2] receive gradients."""
        colour, _, depth = self._values["render_mode"].partition("+")
        parts = []
        cover = None
        if colour == "RGB":
            image, cover = self._colours(centres)
            parts.append(image)
        else:
            depth = colour
        if depth:
            image, cover = self._blended(self.seen[2][:, None], torch.zeros(1), centres)
            parts.append(image / cover.clamp_min(_LEAST_COVER) if depth == "ED" else image)
        return torch.cat(parts, dim=-1), cover

    def _colours(self, centres: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the image [H,W,D] of colours, features or spherical harmonics on a background, and its cover."""
        values = self._values
        degree = values["sh_degree"]
        channels = values["colors"]
        if channels.ndim == (3 if degree is None else 4):  # of each view
            channels = channels[self._number]
        backgrounds = values["backgrounds"]
        width = channels.shape[-1]
        background = torch.zeros(width) if backgrounds is None else backgrounds[self._number]
        if degree is None:
            return self._blended(channels, background, centres)
        zeros = torch.zeros(_BEHIND, device=background.device)
        image = self._image(channels[:, : (degree + 1) ** 2], torch.cat([background, zeros]), centres)
        return image[..., :width], image[..., -1:]

    def _blended(
        self, features: torch.Tensor, background: torch.Tensor, centres: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the image [H,W,D] of features [K,D], and its cover."""
        ones = torch.ones_like(features[:, :1])
        zero = torch.zeros(1, device=background.device)
        image = self._image(torch.cat([features, ones], dim=1), torch.cat([background, zero]), centres)
        return image[..., :-1], image[..., -1:]

    def _image(self, channels: torch.Tensor, background: torch.Tensor, centres: torch.Tensor) -> torch.Tensor:
        means, quats, scales, opacities = self._geometry
        inputs = BlendInputs(background.float(), means, quats, scales, opacities, channels.float(), centres)
        return renderer().blend(self._near, inputs)
