"""SecureGS's public model, anchors in a Scaffold-GS .ply and the networks beside it; and its key, private networks.

::

    <key>/securegs_hidden.npz       {offset,opacity,cov,color}.{0,2}.{weight,bias}
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, Self

import numpy as np
from numpy.typing import NDArray

from gspure.cameras.camera import Camera
from gspure.errors import InputError
from gspure.files import Float32, Kind, digest, load_arrays, replacing, save_arrays
from gspure.model import Gaussians, model_file, read_model
from gspure.model.finite import require_computed
from gspure.opencl.device import Device, choose_device
from gspure.opencl.frame import Energy
from gspure.public_model import BLACK, Background, Columns, Lesson, PublicModel, RenderView, Rows, merge_by_row
from gspure.renderer import Renderer
from gspure.schemes.scheme import Key
from gspure.schemes.secure_gs.anchors import Anchors, Neural, as_gaussians, neural, require_anchors, visible_rows
from gspure.schemes.secure_gs.networks import PARAMETERS, PRIVATE, UNITED, Networks, fresh, read_networks, require_sizes
from gspure.schemes.tensors import write_tensors

if TYPE_CHECKING:
    from gspure.schemes.secure_gs.learner import Learner


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
    network_name = UNITED
    visible = True  # a model without its networks cannot be read
    code: ClassVar[Sequence[Path]] = [Path(__file__).with_name(f"{n}.py") for n in ("networks", "anchors")]

    def __init__(self, model: Gaussians, networks: Networks, stored: bytes = b"") -> None:
        super().__init__(model)
        self.networks = networks
        self.stored = stored  # the file that the networks were read from, if it is `UNITED`: it may hold more tensors

    @cached_property
    def anchors(self) -> Anchors:
        """The rows as input of the networks."""
        return Anchors.of(self.model)

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a model's .ply, or its folder, and the networks beside the .ply."""
        file = model_file(Path(path))
        rows = read_model(file)
        require_anchors(file, rows)
        united = file.with_name(UNITED)
        public = cls(rows, read_networks(file.parent), united.read_bytes() if united.is_file() else b"")
        require_sizes(file.parent, public.networks, public.anchors.feat_dim, public.anchors.k)
        return public

    def write_networks(self, folder: Path) -> None:
        """Write the networks, byte for byte as they were read."""
        if self.stored:
            with replacing(folder / UNITED) as temporary:
                temporary.write_bytes(self.stored)
        else:
            write_tensors(folder / UNITED, {f"{name}_mlp": network for name, network in self.networks.items()})

    def with_model(self, model: Gaussians) -> Self:
        """Return the same networks with other anchors."""
        return type(self)(model, self.networks, self.stored)

    def neural(self, camera: Camera, networks: Networks | None = None) -> tuple[Neural, Rows]:
        """Return the Gaussians of `networks` (default: the public ones) and the rows of the visible anchors."""
        rows = visible_rows(camera, self.model.means, self.model.quats, self.model.scales)
        with np.errstate(over="ignore"):
            centre = camera.centre.astype(np.float32)
            return neural(np, self.anchors.at(rows), networks or self.networks, centre), rows

    def gaussians(self, camera: Camera, networks: Networks | None = None) -> tuple[Gaussians, Rows]:
        """Return the active Gaussians of `networks` (default: the public ones) for a camera, and the anchor of each."""
        gaussians, rows = as_gaussians(*self.neural(camera, networks), self.anchors.k)
        require_computed(gaussians, "key" if networks else "model", "networks")
        return gaussians, rows

    def scene(self, device: Device | None = None, background: Background = BLACK, energy: Energy = "ewa") -> RenderView:
        """Return the renderer of the scene."""
        device = device or choose_device()
        return lambda camera: Renderer(self.gaussians(camera)[0], device, energy=energy).image(camera, background)

    def learned(self, lesson: Lesson) -> Self:
        """Return the model with features, scalings and offsets learned through the public networks, which stay."""
        rates = lesson.rates(self.rates)
        groups = {"features": "colour", "log_scalings": "scale", "offsets": "position"}
        learner = self.trained(lesson, self.networks, {group: rates.get(name, 0.0) for group, name in groups.items()})
        return self._with_attributes(learner.anchors.table, rates)

    def trained(self, lesson: Lesson, networks: Networks, rates: Mapping[str, float]) -> Learner:
        """Return the learner of anchors and networks after a lesson; `rates` names what learns, and how fast."""
        from gspure.schemes.secure_gs.learner import LEARNED, Learner
        from gspure.training.pytorch import single_threaded

        fixed = dict.fromkeys((*LEARNED, *networks), 0.0)
        with single_threaded():
            learner = Learner(self.anchors, [networks], [lesson.images], lesson.device or choose_device())
            for view, factor in lesson.schedule():
                scales = np.exp(learner.anchors.log_scalings[:, :3])
                rows = visible_rows(lesson.views[view], self.model.means, self.model.quats, scales)
                learner.differentiate(0, lesson.views[view], rows, view, 1.0, lesson.background)
                learner.step(fixed | {name: factor * rate for name, rate in rates.items()})
        return learner

    def opacities(self, cameras: Sequence[Camera]) -> Float32:
        """Return the mean opacity [M] of each anchor over its Gaussians and the views where it is visible, if any."""
        total, views = np.zeros(len(self.model)), np.zeros(len(self.model))
        for camera in cameras:
            gaussians, rows = self.neural(camera)
            total[rows] += np.maximum(gaussians.outputs, 0).mean(axis=1)
            views[rows] += 1
        return np.asarray(total / np.maximum(views, 1), np.float32)

    def contributions(self, device: Device | None = None, energy: Energy = "ray") -> Callable[[Camera], NDArray[Any]]:
        """Return a function from a camera to the contributions of each anchor that any of its Gaussians touch."""
        device = device or choose_device()

        def of_view(camera: Camera) -> NDArray[Any]:
            gaussians, owners = self.gaussians(camera)
            return merge_by_row(Renderer(gaussians, device, energy=energy).contributions(camera), owners)

        return of_view

    def geometry_digest(self) -> str:
        """Return a digest of the rows and the networks."""
        weights = [network[name] for network in self.networks.values() for name in sorted(network)]
        return digest(self.model.geometry_digest(), *self.networks, *weights)


HIDDEN: Final = "securegs_hidden.npz"
FIT_RATE: Final = 2e-3  # first learning rate of `HiddenKey.fitted`; ours


class HiddenKey(Key):
    """The private networks: ``offset``, ``opacity``, ``cov`` and ``color``."""

    def __init__(self, networks: Networks) -> None:
        self.networks = networks

    @property
    def sizes(self) -> tuple[int, int]:
        """Length of the features, which is also the width of the hidden layer, and Gaussians per anchor."""
        return int(self.networks["opacity"]["0.bias"].size), int(self.networks["opacity"]["2.bias"].size)

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read a key."""
        shapes = dict.fromkeys(PARAMETERS, (None,)) | dict.fromkeys(PARAMETERS[::2], (None, None))
        kinds: dict[str, Kind] = {f"{name}.{p}": (np.float32, shapes[p]) for name in PRIVATE for p in PARAMETERS}
        arrays = load_arrays(file := Path(folder) / HIDDEN, kinds, "the private networks of SecureGS")
        key = cls({name: {p: arrays[f"{name}.{p}"] for p in PARAMETERS} for name in PRIVATE})
        require_sizes(file, key.networks, *key.sizes)
        return key

    def write(self, folder: Path) -> None:
        """Write the networks."""
        named = {f"{name}.{p}": array for name, network in self.networks.items() for p, array in network.items()}
        save_arrays(Path(folder) / HIDDEN, named)

    def message(self, public: PublicModel, extraction: str, device: Device | None = None) -> RenderView:
        """Return the renderer of the private networks' Gaussians."""
        device = device or choose_device()
        return lambda camera: Renderer(self.gaussians(public, camera, extraction)[0], device).image(camera)

    def gaussians(self, public: PublicModel, camera: Camera, extraction: str) -> tuple[Gaussians, Rows]:  # noqa: ARG002
        """Return the hidden Gaussians of a camera, and the anchor of each."""
        anchors, networks = self._fitting(public)
        return anchors.gaussians(camera, networks)

    def fitted(self, public: PublicModel, lesson: Lesson) -> Self:
        """Return the private networks after training on the model's anchors; the model stays as it is."""
        anchors, networks = self._fitting(public)
        trained = anchors.trained(lesson, networks, dict.fromkeys(self.networks, FIT_RATE)).networks(0)
        return type(self)({name: trained[name] for name in self.networks})

    def wrong(self, rng: np.random.Generator) -> Self:
        """Return untrained networks."""
        return type(self)(fresh(PRIVATE, *self.sizes, rng))

    def _fitting(self, public: PublicModel) -> tuple[AnchorModel, Networks]:
        """Return a model whose anchors the networks can read, and these, with the public one that blends features."""
        if not isinstance(public, AnchorModel):
            raise InputError("secure_gs", "model", expected="anchors", found="Gaussians")
        if (sizes := (public.anchors.feat_dim, public.anchors.k)) != self.sizes:
            expected, found = ("{} features and {} Gaussians per anchor".format(*of) for of in (self.sizes, sizes))
            raise InputError("secure_gs", "model", expected=expected, found=found, hint="a key of another model")
        return public, {**public.networks, **self.networks}
