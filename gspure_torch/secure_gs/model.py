"""SecureGS's public model: anchors in a Scaffold-GS .ply, and the networks beside it. The files of networks.

::

    <public>/securegs_public.npz    {opacity,cov,color}.{0,2}.{weight,bias}
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, Self

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, Kind, load_arrays, save_arrays
from gspure.cameras.camera import Camera
from gspure.constants import Energy
from gspure.errors import InputError
from gspure.files import digest
from gspure.model import Gaussians, model_file, read_model
from gspure.model.finite import require_computed
from gspure.opencl.device import Device, choose_device
from gspure.public_model import Background, Columns, Lesson, PublicModel, RenderView, Rows, merge_by_row
from gspure.renderer import BLACK, Renderer
from gspure_torch.secure_gs.anchors import (
    PARAMETERS,
    PUBLIC,
    Anchors,
    Networks,
    Neural,
    active_gaussians,
    network_shapes,
    neural,
    require_anchors,
    sizes_of,
    visible_rows,
)

if TYPE_CHECKING:
    from gspure_torch.secure_gs.learner import Learner

NETWORKS: Final = "securegs_public.npz"


class AnchorModel(PublicModel):
    """A Scaffold-GS model, the public model of SecureGS: a table whose rows [M] are anchors, and `PUBLIC` networks."""

    attributes: ClassVar[Columns] = {
        "colour": ("f_anchor_feat_*",),
        "base_colour": ("f_anchor_feat_*",),
        "scale": ("scale_*",),
        "position": ("x", "y", "z", "f_offset_*"),
    }
    """Without the opacities and rotations that Scaffold-GS stores but does not use."""

    rates: ClassVar[Mapping[str, float]] = {"colour": 2e-3, "scale": 3e-4, "position": 1e-4}
    """Learning rates of features, logarithms of scalings and offsets, whose unit is the scaling. Ours."""

    rows_are_gaussians: ClassVar[bool] = False
    network_name = NETWORKS
    visible = True  # a model without its networks cannot be read
    code: ClassVar[Sequence[Path]] = [Path(__file__).with_name("anchors.py")]

    def __init__(self, model: Gaussians, networks: Networks) -> None:
        super().__init__(model)
        self.networks = networks

    @cached_property
    def anchors(self) -> Anchors:
        """The rows as input of the networks."""
        return Anchors.from_table(self.model)

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a model's .ply, or its folder, and the networks beside the .ply."""
        file = model_file(Path(path))
        model = read_model(file)
        networks_file = file.with_name(NETWORKS)
        if not networks_file.is_file():
            hint = "files of Scaffold-GS's and SecureGS's authors are not read"
            raise InputError(file.parent, "networks", expected=f"{NETWORKS} of `gspure embed`", found="none", hint=hint)
        networks = read_networks(networks_file, PUBLIC, "the public networks of SecureGS")
        feat_dim, k = sizes_of(networks)
        require_anchors(file, model, feat_dim, k)
        return cls(model, networks)

    def write_networks(self, folder: Path) -> None:
        """Write the networks."""
        write_networks(folder / NETWORKS, self.networks)

    def with_model(self, model: Gaussians) -> Self:
        """Return the same networks with other anchors."""
        return type(self)(model, self.networks)

    @property
    def features(self) -> Float32:
        """The features [M,F] of the anchors."""
        features: Float32 = self.anchors.features
        return features

    def with_features(self, features: NDArray[Any]) -> Self:
        """Return the same networks with other features."""
        names = self.model.columns_named("f_anchor_feat_")
        return self.with_model(self.model.with_columns(dict(zip(names, features.T, strict=True))))

    def mixed(self, rng: np.random.Generator) -> Self:
        """Return a model with rotated features; the first layer of each network rotates them back."""
        feat_dim = self.anchors.feat_dim
        turn, _ = np.linalg.qr(rng.standard_normal((feat_dim, feat_dim)))
        networks = {}
        for name, network in self.networks.items():
            of_features, of_view = np.split(network["0.weight"], [feat_dim], axis=1)
            first = np.concatenate([of_features @ turn, of_view], axis=1).astype(np.float32)
            networks[name] = {**network, "0.weight": first}
        return type(self)(self.with_features(self.features @ turn).model, networks)

    def neural(self, camera: Camera, networks: Networks | None = None) -> tuple[Neural, Rows]:
        """Return the Gaussians of `networks` (default: the public ones) and the rows of the visible anchors."""
        rows = visible_rows(camera, self.model.means, self.model.quats, self.model.scales)
        with np.errstate(over="ignore"):
            centre = camera.centre.astype(np.float32)
            gaussians = neural(np, self.anchors.at(rows), networks or self.networks, centre)
        return gaussians, rows

    def gaussians(self, camera: Camera, networks: Networks | None = None) -> tuple[Gaussians, Rows]:
        """Return the active Gaussians of `networks` (default: the public ones) for a camera, and the anchor of each."""
        neural_gaussians, visible = self.neural(camera, networks)
        gaussians, owners = active_gaussians(neural_gaussians, visible, self.anchors.k)
        require_computed(gaussians, "key" if networks else "model", "networks")
        return gaussians, owners

    def scene(self, device: Device | None = None, background: Background = BLACK, energy: Energy = "ewa") -> RenderView:
        """Return the renderer of the scene."""
        device = device or choose_device()
        return lambda camera: Renderer(self.gaussians(camera)[0], device, energy=energy).image(camera, background)

    def learned(self, lesson: Lesson) -> Self:
        """Return the model with features, scalings and offsets learned through the public networks, which are fixed."""
        rates = lesson.rates(self.rates)
        groups = {"features": "colour", "log_scalings": "scale", "offsets": "position"}
        rate_by_group = {group: rates.get(attribute, 0.0) for group, attribute in groups.items()}
        learner = self.trained(lesson, self.networks, rate_by_group)
        return self._with_attributes(learner.anchors.table, rates)

    def trained(self, lesson: Lesson, networks: Networks, rates: Mapping[str, float]) -> Learner:
        """Return the learner of anchors and networks after a lesson; groups of parameters without a rate are fixed."""
        from gspure_torch.pytorch import single_threaded
        from gspure_torch.secure_gs.learner import LEARNED, Learner

        fixed = dict.fromkeys((*LEARNED, *networks), 0.0)
        with single_threaded():
            learner = Learner(self.anchors, [networks], lesson.device or choose_device())
            learner.show([lesson.images])
            for view, factor in lesson.schedule():
                scales = np.exp(learner.anchors.log_scalings[:, :3])
                rows = visible_rows(lesson.views[view], self.model.means, self.model.quats, scales)
                learner.differentiate(0, lesson.views[view], rows, view, 1.0, lesson.background)
                learner.step(fixed | {name: factor * rate for name, rate in rates.items()})
        return learner

    def opacities(self, cameras: Sequence[Camera]) -> Float32:
        """Return the mean opacity [M] of each anchor over its Gaussians and the views where it is visible; else 0."""
        total = np.zeros(len(self.model))
        views = np.zeros(len(self.model))
        for camera in cameras:
            gaussians, rows = self.neural(camera)
            total[rows] += np.maximum(gaussians.outputs, 0).mean(axis=1)
            views[rows] += 1
        return np.asarray(total / np.maximum(views, 1), np.float32)

    def contributions(self, device: Device | None = None, energy: Energy = "ray") -> Callable[[Camera], NDArray[Any]]:
        """Return a function from a camera to the contributions of the anchors that have a Gaussian in its view."""
        device = device or choose_device()

        def view_contributions(camera: Camera) -> NDArray[Any]:
            gaussians, owners = self.gaussians(camera)
            return merge_by_row(Renderer(gaussians, device, energy=energy).contributions(camera), owners)

        return view_contributions

    def geometry_digest(self) -> str:
        """Return a digest of the rows and the networks."""
        weights = [network[name] for network in self.networks.values() for name in sorted(network)]
        return digest(self.model.geometry_digest(), *self.networks, *weights)


def read_networks(file: Path, names: tuple[str, ...], content: str) -> Networks:
    """Read networks, or raise `InputError` if they do not fit one another."""
    kinds: dict[str, Kind] = {}
    for name in names:
        for parameter in PARAMETERS:
            shape = (None, None) if parameter.endswith("weight") else (None,)
            kinds[f"{name}.{parameter}"] = (np.float32, shape)
    arrays = load_arrays(file, kinds, content)
    networks = {name: {p: arrays[f"{name}.{p}"] for p in PARAMETERS} for name in names}
    feat_dim, k = sizes_of(networks)
    for name, network in networks.items():
        expected = network_shapes(name, feat_dim, k)
        shapes = tuple(array.shape for array in network.values())
        if shapes != expected:
            raise InputError(file, name, expected=f"weights and biases {expected}", found=str(shapes))
    return networks


def write_networks(file: Path, networks: Networks) -> None:
    """Write networks; the same ones give the same bytes."""
    save_arrays(file, {f"{name}.{p}": array for name, network in networks.items() for p, array in network.items()})
