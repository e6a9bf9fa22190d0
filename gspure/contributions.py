"""Per-view contributions on disk: each view is computed once for as long as nothing that it depends on changes.

A stage is one file per view, ``{view}.{key}.npy``. Its key is a digest of everything that its numbers depend on, so a
stage is never stale: an edited camera, model or kernel asks for another key. An index (one .tsv per job, written last)
lists the stages that make up a result.
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray

import gspure.opencl
import gspure.renderer
from gspure.artifacts import digest, load_array, save_array, write_text
from gspure.cameras import Camera
from gspure.errors import InputError, reading
from gspure.model import Gaussians, require_finite
from gspure.opencl.device import Device
from gspure.opencl.frame import Energy
from gspure.opencl.program import kernel_digest
from gspure.progress import say, track
from gspure.renderer import CONTRIBUTION

GEOMETRY = ("x", "y", "z", *(f"rot_{i}" for i in range(4)), *(f"scale_{i}" for i in range(3)), "opacity")
"""The columns that contributions depend on: colours are not among them."""

INDEX_COLUMNS = ["view", "key", "path"]


@dataclass(frozen=True)
class Stage:
    """The stored contributions of one view: which view, the key of its content, and the file."""

    view: str
    key: str
    path: Path


class Contributor(Protocol):
    """A model of any scheme (`gspure.schemes.asset.Asset`): rows, and what each contributes to a view."""

    units: Gaussians

    def geometry_digest(self) -> str:
        """Return a digest of all that contributions depend on."""

    def contributions(self, device: Device | None, energy: Energy) -> Callable[[Camera], NDArray[Any]]:
        """Return what gives each touched row's `CONTRIBUTION` to a view."""


def contribute(
    asset: Contributor, cameras: Sequence[Camera], folder: Path, *, device: Device | None = None, energy: Energy = "ray"
) -> list[Stage]:
    """Make sure that `folder` holds the contributions of `asset` to every view, computing only those that are absent.

    The model goes to the device, and the kernels are built, once and only if a view is absent.

    Parameters
    ----------
    asset : Contributor
    cameras : sequence of Camera
        Views with unique names.
    folder : Path
        Where the stage files live.
    device : Device, optional
        Default: the device that `gspure.opencl` chooses.
    energy : {"ray", "ewa"}
        How a Gaussian is evaluated at a pixel; "ray" is the paper's equation.

    Returns
    -------
    list of Stage
        One per camera, in the order of `cameras`.

    Raises
    ------
    InputError
        If the model holds a number that is not finite.

    """
    require_finite(asset.units, "model")
    geometry = asset.geometry_digest()
    stages = []
    for camera in cameras:
        key = contribution_key(geometry, camera, energy)
        stages.append(Stage(camera.name, key, folder / f"{camera.name}.{key}.npy"))
    absent = [pair for pair in zip(cameras, stages, strict=True) if not pair[1].path.exists()]
    if absent:
        contributions = asset.contributions(device, energy)
        for camera, stage in track(absent, "contributions"):
            save_array(stage.path, contributions(camera))
    say(f"contributions: {len(absent)} of {len(stages)} views computed, {len(stages) - len(absent)} already stored")
    return stages


def geometry_digest(model: Gaussians) -> str:
    """Return a digest of the columns of `model` that contributions depend on, as stored."""
    return digest(model.columns(*GEOMETRY))


def contribution_key(geometry: str, camera: Camera, energy: str) -> str:
    """Return the key of one view's contributions: a digest of geometry, camera numbers, energy and rendering code."""
    return digest(geometry, camera.numbers, energy, rendering_digest())


@cache
def rendering_digest() -> str:
    """Return a digest of all that turns a model and a camera into numbers: kernels, constants and their host code."""
    host = [Path(gspure.renderer.__file__), *sorted(Path(gspure.opencl.__path__[0]).glob("*.py"))]
    return digest(kernel_digest(), *(path.read_bytes() for path in host))


def read_stage(path: Path) -> NDArray[Any]:
    """Read one stage: an array of `gspure.renderer.CONTRIBUTION` over the touched Gaussians, sorted by index."""
    if not Path(path).exists():
        hint = "stage files were removed; compute them again: snakemake --forcerun measure_contributions"
        raise InputError(path, "file", expected="a stage listed by an index", found="nothing", hint=hint)
    return load_array(path, dtype=CONTRIBUTION, shape=(None,))


def write_index(path: Path, stages: Iterable[Stage]) -> None:
    """Write the list of `stages`; their paths are stored relative to the index, so that a project can be moved."""
    text = io.StringIO()
    table = csv.writer(text, delimiter="\t", lineterminator="\n")
    table.writerow(INDEX_COLUMNS)
    table.writerows((stage.view, stage.key, os.path.relpath(stage.path, path.parent)) for stage in stages)
    write_text(path, text.getvalue())


def read_index(*paths: Path) -> list[Stage]:
    """Read the stages that one or more indices list, sorted by view.

    The order, and so every sum over the views, does not depend on how the views were dealt out to jobs.

    Raises
    ------
    InputError
        If a file is not an index, or if two entries are of the same view.

    """
    stages = sorted((stage for path in paths for stage in _read_one_index(path)), key=lambda stage: stage.view)
    for one, other in pairwise(stages):
        if one.view == other.view:
            raise InputError(paths[-1], "view", expected="each view in one index only", found=f"{one.view!r} twice")
    return stages


def _read_one_index(path: Path) -> list[Stage]:
    with (
        reading(path, "an index of contributions"),
        Path(path).open(encoding="utf-8", newline="") as stream,
    ):
        header, *rows = list(csv.reader(stream, delimiter="\t")) or [[]]
    if header != INDEX_COLUMNS or any(len(row) != len(INDEX_COLUMNS) for row in rows):
        raise InputError(path, "columns", expected=" ".join(INDEX_COLUMNS), found=" ".join(header) or "nothing")
    return [Stage(view, key, Path(os.path.normpath(path.parent / file))) for view, key, file in rows]


def remove_unlisted(folder: Path, indices: Sequence[Path]) -> tuple[int, int]:
    """Delete the stage files below `folder` that none of `indices` lists.

    Returns
    -------
    (files, bytes) : tuple of int
        How many were deleted and how much room that frees.

    """
    listed = {stage.path.resolve() for index in indices for stage in _read_one_index(index)}
    unlisted = [path for path in sorted(folder.rglob("*.npy")) if path.resolve() not in listed]
    freed = sum(path.stat().st_size for path in unlisted)
    for path in unlisted:
        path.unlink()
    return len(unlisted), freed
