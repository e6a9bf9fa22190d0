"""The public model: anchors in a Scaffold-GS .ply, and the networks beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.model import Gaussians, read_model, write_model
from gspure.model.inria import point_cloud
from gspure.opencl.device import Device, choose_device
from gspure.opencl.frame import Energy
from gspure.renderer import Renderer
from gspure.schemes.asset import BLACK, Asset, Background, Columns, Units, View, digest_of, of_units
from gspure.schemes.secure_gs.anchors import Anchors, anchors_of, require_anchors
from gspure.schemes.secure_gs.files import read_networks, write_networks
from gspure.schemes.secure_gs.networks import Networks, require_networks
from gspure.schemes.secure_gs.neural import Neural, as_gaussians, neural
from gspure.schemes.secure_gs.visibility import visible_rows

Float32 = NDArray[np.float32]


class AnchorAsset(Asset):
    """A Scaffold-GS model, which is what SecureGS publishes. Its units are anchors.

    Parameters
    ----------
    units : Gaussians
        The rows [M] of its file.
    networks : Networks
        ``opacity``, ``cov``, ``color`` and, if it has one, ``feature_bank``.

    """

    attributes: ClassVar[Columns] = {
        "colour": ("f_anchor_feat_*",),
        "base_colour": ("f_anchor_feat_*",),
        "scale": ("scale_*",),
        "position": ("x", "y", "z", "f_offset_*"),
    }
    """Nothing reads the opacities and rotations that Scaffold-GS stores with its anchors."""

    rows_are_gaussians: ClassVar[bool] = False

    def __init__(self, units: Gaussians, networks: Networks) -> None:
        super().__init__(units)
        self.networks = networks

    @cached_property
    def anchors(self) -> Anchors:
        """The rows as the networks take them."""
        return anchors_of(self.units)

    @property
    def visible(self) -> bool:
        """True: there is no such model without its networks."""
        return True

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a model: its .ply, or the folder that holds it, and the networks beside the .ply."""
        file = point_cloud(path) if Path(path).is_dir() else Path(path)
        units = read_model(file)
        require_anchors(file, units)
        asset = cls(units, read_networks(file.parent))
        require_networks(file.parent, asset.networks, asset.anchors.feat_dim, asset.anchors.k)
        return asset

    def write(self, path: Path) -> None:
        """Write the .ply, and the networks beside it."""
        write_model(path, self.units)
        write_networks(Path(path).parent, self.networks)

    def with_units(self, units: Gaussians) -> Self:
        """Return the same model with other anchors."""
        return type(self)(units, self.networks)

    def seen(self, camera: Camera, networks: Networks | None = None) -> tuple[Neural, Units]:
        """Return a camera's Gaussians by these networks (default: the public ones), and the rows of its anchors."""
        rows = visible_rows(camera, self.units.means, self.units.quats, self.units.scales)
        with np.errstate(over="ignore"):
            found = neural(np, self.anchors.at(rows), networks or self.networks, camera.centre.astype(np.float32))
        return found, rows

    def gaussians(self, camera: Camera) -> tuple[Gaussians, Units]:
        """Return the active neural Gaussians of a camera, and the anchor of each."""
        found, rows = self.seen(camera)
        return as_gaussians(found, self.anchors.k, rows)

    def scene(self, device: Device | None = None, background: Background = BLACK, energy: Energy = "ewa") -> View:
        """Return what everybody sees."""
        device = device or choose_device()
        return lambda camera: Renderer(self.gaussians(camera)[0], device, energy=energy).image(camera, background)

    def opacities(self, cameras: Sequence[Camera]) -> Float32:
        """Return the opacity [M] of each anchor: the mean of its Gaussians', over the views that have it.

        The opacities in the file are one constant. This mean is k times smaller than the sum that Scaffold-GS prunes
        by. An anchor that no view has gets 0.
        """
        total, views = np.zeros(len(self.units)), np.zeros(len(self.units))
        for camera in cameras:
            found, rows = self.seen(camera)
            total[rows] += np.maximum(found.outputs, 0).mean(axis=1)
            views[rows] += 1
        return np.asarray(total / np.maximum(views, 1), np.float32)

    def contributions(self, device: Device | None = None, energy: Energy = "ray") -> Callable[[Camera], NDArray[Any]]:
        """Return what gives, for a camera, each touched anchor's contributions: those of its Gaussians together."""
        device = device or choose_device()

        def of_view(camera: Camera) -> NDArray[Any]:
            gaussians, units = self.gaussians(camera)
            return of_units(Renderer(gaussians, device, energy=energy).contributions(camera), units)

        return of_view

    def geometry_digest(self) -> str:
        """Return a digest of the rows, of the networks, and of the code that makes Gaussians of them."""
        weights = [network[name] for network in self.networks.values() for name in sorted(network)]
        code = [Path(__file__).with_name(f"{name}.py").read_bytes() for name in ("networks", "neural", "visibility")]
        return digest_of(self, *self.networks, *weights, *code)
