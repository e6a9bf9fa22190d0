"""The classes of `diff_gaussian_rasterization`, in any dialect."""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from gspure.cameras.camera import Camera
from gspure.constants import NEAR_PLANE
from gspure_torch.bridge import BlendInputs, TorchRenderer
from gspure_torch.cuda_free.dialects import Dialect
from gspure_torch.cuda_free.projection import (
    antialiasing,
    axes_of,
    camera_of,
    depths,
    image_covariances,
    seen_from,
    world_covariances,
)
from gspure_torch.pytorch import torch


def interface(dialect: Dialect) -> tuple[type[Any], type[Any]]:
    """Return the classes `GaussianRasterizationSettings` and `GaussianRasterizer` of a dialect."""
    optional = [False] if "antialiasing" in dialect.settings else []
    settings = namedtuple("GaussianRasterizationSettings", dialect.settings, defaults=optional)  # type: ignore[misc]  # noqa: PYI024
    rasterizer = type("GaussianRasterizer", (_Rasterizer,), {"dialect": dialect})
    return settings, rasterizer


class _Rasterizer(torch.nn.Module):  # type: ignore[misc]
    """The rasterizer of one view; its arguments and outputs are those of its dialect."""

    dialect: Dialect

    def __init__(self, raster_settings: Any) -> None:
        super().__init__()
        self.raster_settings = raster_settings

    @torch.no_grad()  # type: ignore[untyped-decorator]
    def markVisible(self, positions: torch.Tensor) -> torch.Tensor:  # noqa: N802
        """Return which `positions` [K,3] lie before the near plane: bool [K]."""
        return seen_from(camera_of(self.raster_settings), positions)[2] > NEAR_PLANE

    @torch.no_grad()  # type: ignore[untyped-decorator]
    def visible_filter(
        self,
        means3D: torch.Tensor,
        scales: torch.Tensor | None = None,
        rotations: torch.Tensor | None = None,
        cov3D_precomp: torch.Tensor | None = None,
    ) -> torch.Tensor:
        """Return the radii [K] of Gaussians, 0 where they are not visible, as Scaffold-GS asks for them."""
        geometry = {"means3D": means3D, "scales": scales, "rotations": rotations, "cov3D_precomp": cov3D_precomp}
        given = {name: tensor for name, tensor in geometry.items() if tensor is not None}
        return _View(self.raster_settings, given).radii()

    def forward(self, *arguments: Any, **named: Any) -> Any:
        """Return the outputs of the dialect: images [C,H,W] and radii [K]."""
        view = _View(self.raster_settings, self.dialect.bound(arguments, named))
        outputs = view.outputs(self.dialect.outputs)
        return outputs if len(outputs) > 1 else outputs[0]


@cache
def renderer() -> TorchRenderer:
    """Return the renderer of this process."""
    return TorchRenderer()


@dataclass(frozen=True)
class _Shapes:
    """Quaternions [K,4] and scales [K,3]; and `precomputed` covariances [6,K], which then carry the gradient."""

    quats: torch.Tensor
    scales: torch.Tensor
    precomputed: torch.Tensor | None = None

    def covariances(self) -> torch.Tensor:
        """Return the covariances [6,K]."""
        return world_covariances(self.quats, self.scales) if self.precomputed is None else self.precomputed


class _View:
    """One call of a rasterizer: a camera and the tensors of Gaussians, by the names of `dialects.KNOWN_INPUTS`."""

    def __init__(self, settings: Any, tensors: Mapping[str, torch.Tensor]) -> None:
        self.camera: Camera = camera_of(settings)
        self._settings = settings
        self._tensors = tensors
        self._means = tensors["means3D"]
        self._shapes = _shapes(tensors, settings.scale_modifier)
        self._antialiased: bool = getattr(settings, "antialiasing", False)

    def radii(self) -> torch.Tensor:
        """Return the radii [K] on the image, without drawing it."""
        opacities = torch.ones(len(self._means))  # which these radii do not depend on
        tensors = (self._means, self._shapes.quats, self._shapes.scales, opacities)
        return renderer().radii(self.camera, *(tensor.float() for tensor in tensors))

    def outputs(self, names: tuple[str, ...]) -> tuple[torch.Tensor, ...]:
        """Return outputs by name; the colour is drawn last, since the device holds the last image for its gradient."""
        has_depth = {"shs", "color", "inverse_depth"} <= {*self._tensors, *names}
        with_colour = {"color", "inverse_depth"} if has_depth else {"color"}
        outputs = self._features([name for name in names if name not in {"radii", *with_colour}])
        if "color" in names:
            image = self._colour(has_depth=has_depth)
            outputs |= {"color": image[:-1], "inverse_depth": image[-1:]} if has_depth else {"color": image}
        if "radii" in names:
            outputs["radii"] = renderer().radii_of_last().to(self._means.device)
        return tuple(outputs[name] for name in names)

    def _features(self, names: list[str]) -> dict[str, torch.Tensor]:
        """Return the outputs that are blended features, all drawn at once, in front of zeros."""
        if not names:
            return {}
        columns = [self._column(name) for name in names]
        widths = [column.shape[1] for column in columns]
        image = self._drawn(torch.cat(columns, dim=1), torch.zeros(sum(widths)))
        return dict(zip(names, image.split(widths), strict=True))

    def _column(self, name: str) -> torch.Tensor:
        """Return what is blended for an output: [K,C]."""
        match name:
            case "features":
                return self._tensors["semantic_feature"].flatten(1)
            case "depth":
                return depths(self.camera, self._means)[:, None]
            case "inverse_depth":
                return 1 / depths(self.camera, self._means)[:, None]
        return torch.ones_like(self._means[:, :1])

    def _colour(self, *, has_depth: bool) -> torch.Tensor:
        """Return the image [C,H,W] of spherical harmonics, or of colours [K,C], in front of the first C of `bg`.

        With spherical harmonics, the inverse depth may follow, in front of zeros.
        """
        bands = self._tensors.get("shs")
        if (bands is None) == ("colors_precomp" not in self._tensors):
            raise ValueError("gspure cuda-free: the rasterizer takes either shs or colors_precomp")
        if bands is None:
            channels = self._tensors["colors_precomp"]
        else:
            most = int(bands.shape[1] ** 0.5) - 1
            channels = bands[:, : (min(self._settings.sh_degree, most) + 1) ** 2]
        background = torch.zeros(channels.shape[-1] + has_depth)
        colour = self._settings.bg[: channels.shape[-1]]
        background[: len(colour)] = colour
        return self._drawn(channels, background)

    def _drawn(self, channels: torch.Tensor, background: torch.Tensor) -> torch.Tensor:
        """Return the image [C,H,W] of features [K,C] or spherical harmonics [K,S,3]."""
        opacities = self._tensors["opacities"].reshape(-1)
        if self._antialiased:
            covariances = image_covariances(self.camera, self._means, self._shapes.covariances())
            opacities = opacities * antialiasing(covariances)
        covs2d = None
        if self._shapes.precomputed is not None:
            covs2d = image_covariances(self.camera, self._means.detach(), self._shapes.precomputed).T
        inputs = BlendInputs(
            background=background,
            means=self._means.float(),
            quats=self._shapes.quats.float(),
            scales=self._shapes.scales.float(),
            opacities=opacities.float(),
            channels=channels.float(),
            means2d=self._centres(),
            covs2d=covs2d,
        )
        return renderer().blend(self.camera, inputs).permute(2, 0, 1)

    def _centres(self) -> torch.Tensor | None:
        """Return what receives the gradients of the centres in pixels, from `means2D` in 3DGS's unit, half a side."""
        means2d = self._tensors.get("means2D")
        if means2d is None:
            return None
        if means2d.shape[1] > 3:
            raise ValueError(f"gspure cuda-free: means2D has 2 or 3 columns, not {means2d.shape[1]}")
        half = torch.tensor([self.camera.width / 2, self.camera.height / 2], device=means2d.device)
        return means2d[:, :2] * half


def _shapes(tensors: Mapping[str, torch.Tensor], scale_modifier: float) -> _Shapes:
    """Return the shapes that a program gives: scales and rotations, or `cov3D_precomp` [K,6]."""
    if ("cov3D_precomp" in tensors) == ("scales" in tensors and "rotations" in tensors):
        raise ValueError("gspure cuda-free: the rasterizer takes either scales and rotations or cov3D_precomp")
    if "cov3D_precomp" in tensors:
        covariances = tensors["cov3D_precomp"].T
        return _Shapes(*axes_of(covariances), covariances)
    scales = tensors["scales"]
    if scale_modifier != 1:
        scales = scales * scale_modifier
    return _Shapes(tensors["rotations"], scales)
