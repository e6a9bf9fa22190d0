"""A public model, as its scheme publishes it."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any, ClassVar, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, Indices
from gspure.cameras.camera import Camera, spread
from gspure.constants import Energy
from gspure.files import filling
from gspure.model import Gaussians, read_model, write_model
from gspure.model.finite import FILTER, drawable, undrawable_rows
from gspure.model.gaussians import CORE, NORMALS
from gspure.opencl.adam import LearningRates
from gspure.opencl.device import Device
from gspure.opencl.trainable import Parameters, TrainableModel, TrainState
from gspure.progress import track
from gspure.renderer import BLACK, CONTRIBUTION, Renderer

Rows = Indices
RenderView = Callable[[Camera], Float32]
"""From a camera to its image [H,W,3], not clipped."""

Background = Sequence[float]

ATTRIBUTES: Final = ("colour", "base_colour", "opacity", "scale", "rotation", "position")
"""Attributes that attacks can request; ``base_colour`` is the view-independent part of the colour."""

Columns = Mapping[str, tuple[str, ...]]
"""The columns of a model by attribute."""


class Lesson(NamedTuple):
    """Images [H,W,3] of views to learn from, and the `attributes` to learn; a model ignores those that it lacks."""

    views: Sequence[Camera]
    images: Sequence[Float32]
    attributes: Collection[str]  # of `ATTRIBUTES`
    steps: int  # one view each
    rng: np.random.Generator  # of the order of views
    rate_factor: float = 1.0
    device: Device | None = None
    background: Background = BLACK

    def rates(self, rates: Mapping[str, float]) -> dict[str, float]:
        """Return the learning rates of the attributes to learn."""
        return {name: rate * self.rate_factor for name, rate in rates.items() if name in self.attributes}

    def schedule(self) -> Iterator[tuple[int, float]]:
        """Return the number of a view for each step, and the factor of the rates, which falls linearly to a tenth."""
        view_count = len(self.views)
        epochs = -(-self.steps // view_count)
        order = np.concatenate([self.rng.permutation(view_count) for _ in range(epochs)])[: self.steps]
        factors = np.linspace(1.0, 0.1, self.steps)
        return track(list(zip(order.tolist(), factors.tolist(), strict=True)), "learn")


class PublicModel:
    """A public model whose Gaussians are its rows: vanilla 3DGS, and the base of all others.

    *Rows* are the rows of its file, which attacks remove or change: Gaussians here, anchors in Scaffold-GS. Attacks
    leave the files beside it (decoders, networks) unchanged, but for `mixed`.
    """

    attributes: ClassVar[Columns] = {
        "colour": ("f_dc_*", "f_rest_*"),
        "base_colour": ("f_dc_*",),
        "opacity": ("opacity",),
        "scale": ("scale_*",),
        "rotation": ("rot_*",),
        "position": ("x", "y", "z"),
    }
    """The columns of each of `ATTRIBUTES` that rows have: names, or ``prefix*`` for numbered ones."""

    rates: ClassVar[Mapping[str, float]] = {
        "colour": 2.5e-3,
        "opacity": 0.025,
        "scale": 5e-3,
        "rotation": 1e-3,
        "position": 1.6e-6,
    }
    """Learning rates by attribute: those of 3DGS; for positions its last one, as a share of the views' extent."""

    rows_are_gaussians: ClassVar[bool] = True
    """Whether rows are Gaussians; false if Gaussians are computed from them for each view."""

    code: ClassVar[Sequence[Path]] = ()
    """Files of the code that computes Gaussians from rows."""

    def __init__(self, model: Gaussians) -> None:
        self.model = model

    @property
    def columns(self) -> Columns:
        """The columns of this model by attribute; numbered ones are sorted by number."""

        def matching(pattern: str) -> tuple[str, ...]:
            if pattern.endswith("*"):
                return self.model.columns_named(pattern.removesuffix("*"))
            return (pattern,) if pattern in self.model.names else ()

        return {
            attribute: tuple(name for pattern in patterns for name in matching(pattern))
            for attribute, patterns in self.attributes.items()
        }

    @property
    def unused_columns(self) -> list[str]:
        """Columns that no image depends on, in the file's order, without those that are constant."""
        used = {*CORE, *NORMALS, FILTER, *chain(*self.columns.values())}
        table = self.model.table
        return [name for name in self.model.names if name not in used and (table[name] != table[name][0]).any()]

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a model's .ply, or its folder, and the files beside the .ply."""
        return cls(read_model(path))

    def write(self, path: Path) -> list[Path]:
        """Write the .ply and the file of networks beside it, if any; return their paths."""
        with filling(path.parent) as folder:
            write_model(folder / path.name, self.model)
            self.write_networks(folder)
        if not self.network_name:
            return [path]
        return [path, path.with_name(self.network_name)]

    @property
    def network_name(self) -> str:
        """Name of the file of networks beside the .ply; empty if there is none."""
        return ""

    def write_networks(self, folder: Path) -> None:
        """Write the networks to a folder."""

    def with_model(self, model: Gaussians) -> Self:
        """Return the same model with other rows, such as attacked ones."""
        return type(self)(model)

    @property
    def features(self) -> Float32:
        """The features [K,F] of rows that a public network reads through linear weights; F = 0 without a network."""
        return np.zeros((len(self.model), 0), np.float32)

    def with_features(self, features: NDArray[Any]) -> Self:  # noqa: ARG002
        """Return the same networks with other `features` [K,F]."""
        return self

    def mixed(self, rng: np.random.Generator) -> Self:  # noqa: ARG002
        """Return a model whose features are random mixes of the old ones, which its network undoes: images stay.

        A model without features, or without its network, is returned unchanged.
        """
        return self

    def drawable(self, source: str | Path) -> Self:
        """Return the model as it is drawn: with the 3-D filter applied and undrawable rows invisible."""
        rows = drawable(self.model, source)
        return self if rows is self.model else self.with_model(rows)

    def drawn(self, source: str | Path) -> Self:
        """Return the model as it is drawn, without its undrawable rows, to which keys may give another opacity."""
        public = self.drawable(source)
        undrawable = undrawable_rows(self.model)
        if not len(undrawable):
            return public
        rows = np.delete(np.arange(len(self.model)), undrawable)
        return public.with_model(public.model[rows])

    def gaussians(self, camera: Camera) -> tuple[Gaussians, Rows]:  # noqa: ARG002
        """Return the Gaussians that a camera sees, and the row of each."""
        return self.model, np.arange(len(self.model))

    @property
    def visible(self) -> bool:
        """Whether the model has everything needed to render the scene."""
        return self.model.sh_degree >= 0

    def scene(self, device: Device | None = None, background: Background = BLACK, energy: Energy = "ewa") -> RenderView:
        """Return the renderer of the scene."""
        renderer = self.renderer(device, energy)
        return lambda camera: renderer.image(camera, background)

    def renderer(self, device: Device | None = None, energy: Energy = "ewa") -> Renderer:
        """Return the renderer of the rows as Gaussians, which are uploaded once."""
        if (device, energy) not in self._renderers:
            self._renderers[device, energy] = Renderer(self.model, device, energy=energy)
        return self._renderers[device, energy]

    @cached_property
    def _renderers(self) -> dict[tuple[Device | None, Energy], Renderer]:
        """The renderers that were asked for."""
        return {}

    def learned(self, lesson: Lesson) -> Self:
        """Return the model with learned values in the columns of the lesson's attributes, all else bit-identical."""
        model = self.model
        parameters = Parameters(model.means, model.quats, model.log_scales, model.table["opacity"], model.sh_coeffs)
        trainable = TrainableModel(TrainState.fresh(parameters), device=lesson.device)
        trainable.set_targets(lesson.images)
        rates = lesson.rates(self.rates)
        extent = spread(lesson.views)
        for view, factor in lesson.schedule():
            step_rates = LearningRates(
                means=factor * rates.get("position", 0.0) * extent,
                quats=factor * rates.get("rotation", 0.0),
                scales=factor * rates.get("scale", 0.0),
                opacities=factor * rates.get("opacity", 0.0),
                sh_dc=factor * rates.get("colour", 0.0),
                sh_rest=factor * rates.get("colour", 0.0) / 20,
            )
            trainable.step(lesson.views[view], view, step_rates, background=lesson.background)
        return self._with_attributes(Gaussians.from_stored(**vars(trainable.state().parameters)), rates)

    def _with_attributes(self, model: Gaussians, attributes: Collection[str]) -> Self:
        """Return the same model with the columns of some attributes of another model."""
        names = [name for attribute in attributes for name in self.columns[attribute]]
        return self.with_model(self.model.with_columns({name: model.table[name] for name in names}))

    def opacities(self, cameras: Sequence[Camera]) -> Float32:  # noqa: ARG002
        """Return the opacities [K] of rows, 0 to 1, a feature of the clustering."""
        return self.model.opacities

    def contributions(self, device: Device | None = None, energy: Energy = "ray") -> Callable[[Camera], NDArray[Any]]:
        """Return a function from a camera to the `gspure.renderer.CONTRIBUTION` records of the rows in its image."""
        return self.renderer(device, energy).contributions

    def geometry_digest(self) -> str:
        """Return a digest of everything in the model that contributions depend on."""
        return self.model.geometry_digest()


def merge_by_row(records: NDArray[Any], owners: Rows) -> NDArray[Any]:
    """Return the contributions of rows from those of Gaussians; `owners` is the row of each Gaussian.

    The sum and the pixels of a row are the sums over its Gaussians; its maximum is the largest of theirs.
    """
    rows, places = np.unique(owners[records["index"]], return_inverse=True)
    merged = np.zeros(len(rows), CONTRIBUTION)
    merged["index"] = rows
    merged["sum"] = np.bincount(places, records["sum"], len(rows))
    merged["pixels"] = np.bincount(places, records["pixels"], len(rows))
    np.maximum.at(merged["max"], places, records["max"])
    return merged
