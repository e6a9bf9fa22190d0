"""Per-view contributions on disk; a view is computed again only if its inputs change.

A stage is one file per view, ``{view}.{key}.npy``. Its key is a digest of everything that its numbers depend on, so an
edited camera, model or kernel gives another file, and none is stale. Its checksum is beside it; a stage that does not
match it counts as missing. An index (one .tsv per job, written last) lists the stages of a part, with what the indices
of all parts share (`Measurement`).
"""

import csv
import io
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

import gspure.opencl
import gspure.renderer
from gspure.artifacts import (
    digest,
    intact,
    load_array,
    record_of,
    remove,
    require_replaceable,
    save_array,
    verify,
    write_text,
)
from gspure.artifacts.checksums import record_file
from gspure.artifacts.replacement import is_result
from gspure.cameras import Camera
from gspure.errors import InputError, reading
from gspure.model import require_finite
from gspure.opencl.device import Device, choose_device
from gspure.opencl.engine import device_identity
from gspure.opencl.frame import Energy
from gspure.opencl.program import kernel_digest
from gspure.progress import say, track
from gspure.public_model import PublicModel
from gspure.renderer import CONTRIBUTION

_STAGE = re.compile(r"\.[0-9a-f]{32}\.npy$")  # ends the name of a stage, {view}.{key}.npy


class Measurement(NamedTuple):
    """What the indices of all parts share."""

    model: str  # digest of the model as stored (`PublicModel.geometry_digest`)
    settings: str  # digest of all views, energy and rendering code
    device: str  # driver, device and kernel style (`gspure.opencl.engine.device_identity`)
    views: int  # number of views in all parts

    @classmethod
    def of(cls, public: PublicModel, model: str, cameras: Sequence[Camera], energy: Energy, device: Device) -> Self:
        """Describe the contributions of `public`, stored with the digest `model`, to all views."""
        geometry = _content(public)
        views = [digest(camera.name, contribution_key(geometry, camera, energy, "")) for camera in cameras]
        return cls(model, digest(*views), device_identity(device), len(views))


INDEX_COLUMNS = ["view", "key", "path", *Measurement._fields]


@dataclass(frozen=True)
class Stage:
    """The stored contributions of one view: which view, the key of its content, and the file."""

    view: str
    key: str
    path: Path


def contribute(
    public: PublicModel,
    cameras: Sequence[Camera],
    folder: Path,
    *,
    device: Device | None = None,
    energy: Energy = "ray",
) -> list[Stage]:
    """Compute the contributions of `public` to every view, except those stored intact in `folder`.

    Views have unique names; return one stage per view. The model is uploaded and the kernels are built once, and only
    if a view is computed. Raise `InputError` if the model holds a number that is not finite.
    """
    require_finite(public.model, "model")
    device = device or choose_device()
    geometry, target = _content(public), device_identity(device)
    stages = []
    for camera in cameras:
        key = contribution_key(geometry, camera, energy, target)
        stages.append(Stage(camera.name, key, folder / f"{camera.name}.{key}.npy"))
    missing = [pair for pair in zip(cameras, stages, strict=True) if not intact(pair[1].path)]
    corrupt = sum(stage.path.exists() for _, stage in missing)
    require_replaceable(*(stage.path for _, stage in missing))
    if missing:
        contributions = public.contributions(device, energy)
        for camera, stage in track(missing, "contributions"):
            save_array(stage.path, contributions(camera), checksum=True)
    computed = f"{len(missing)} of {len(stages)} views computed" + (f" ({corrupt} were corrupt)" if corrupt else "")
    say(f"contributions: {computed}, {len(stages) - len(missing)} already stored")
    return stages


def _content(public: PublicModel) -> str:
    """Return a digest of a model and of the code that computes its Gaussians."""
    return digest(public.geometry_digest(), *(file.read_bytes() for file in public.code))


def contribution_key(geometry: str, camera: Camera, energy: str, device: str) -> str:
    """Return the key of one view's contributions, a digest of everything that they depend on.

    `geometry` is a digest of the model and its code, `device` a name
    (`gspure.opencl.engine.device_identity`). The camera's numbers count, not its name.
    """
    return digest(geometry, camera.numbers, energy, rendering_digest(), device)


@cache
def rendering_digest() -> str:
    """Return a digest of the kernels, constants and host code of rendering."""
    host = [Path(gspure.renderer.__file__), *sorted(Path(gspure.opencl.__path__[0]).glob("*.py"))]
    return digest(kernel_digest(), *(path.read_bytes() for path in host))


def read_stage(path: Path, count: int | None = None) -> NDArray[Any]:
    """Read one stage: an array of `gspure.renderer.CONTRIBUTION` over the touched rows, sorted by index.

    Raise `InputError` if the file is missing, corrupt or a copy of another stage, names a row that a model of `count`
    rows does not have, or holds what no view of a model has: see `require_valid`.
    """
    stage = load_array(path, dtype=CONTRIBUTION, shape=(None,))
    if (name := (record_of(path) or {}).get("artifact", path.name)) != path.name:
        raise InputError(path, "record", expected=path.name, found=name, hint="a copy of another stage; delete it")
    require_valid(path, stage)
    if count is not None and len(stage) and (last := int(stage["index"][-1])) >= count:
        raise InputError(path, "index", expected=f"rows 0 to {count - 1} of the model", found=f"row {last}")
    return stage


def require_valid(source: str | Path, stage: NDArray[Any]) -> None:
    """Check the contributions [T] of one view, given as `CONTRIBUTION` of finite numbers.

    Indices ascend, every row is touched by a pixel, and as a pixel gives a row between 0 and 1: 0 <= max <= sum <=
    pixels, max <= 1. The kernels for GPUs round each pixel's share of the sum to a multiple of 2^-23, by at most 2^-24.

    Raise `InputError` of `source` with the first row of the model at fault and its values.
    """
    ascending = np.append(True, stage["index"][1:] > stage["index"][:-1])
    total, largest, pixels = (stage[name].astype(np.float32) for name in ("sum", "max", "pixels"))
    least = total + pixels * np.float32(2**-24)
    bounded = (total >= 0) & (largest >= 0) & (largest <= np.minimum(least, 1)) & (total <= pixels) & (pixels > 0)
    for fits, expected in ((ascending, "ascending indices"), (bounded, "0 <= max <= sum <= pixels and max <= 1")):
        if not fits.all():
            wrong = stage[fits.argmin()]
            found = f"sum {wrong['sum']}, max {wrong['max']}, pixels {wrong['pixels']}"
            raise InputError(source, f"row {wrong['index']}", expected=expected, found=found)


def write_index(path: Path, stages: Iterable[Stage], measurement: Measurement) -> None:
    """Write the list of `stages`; their paths are stored relative to the index, so that a project can be moved."""
    text = io.StringIO()
    table = csv.writer(text, delimiter="\t", lineterminator="\n")
    table.writerow(INDEX_COLUMNS)
    paths = ((stage, os.path.relpath(stage.path, path.parent)) for stage in stages)
    table.writerows((stage.view, stage.key, file, *measurement) for stage, file in paths)
    write_text(path, text.getvalue())


def is_stage(path: Path) -> bool:
    """Return whether a file is a stage, by its name."""
    return _STAGE.search(path.name) is not None


def is_index(path: Path) -> bool:
    """Return whether a file below a folder of results is an index, by its path."""
    benchmark = ("results", "benchmarks") in pairwise(path.parts)  # Snakemake's, of the job that wrote the index
    return path.suffix == ".tsv" and path.parent.name == "contributions" and not benchmark


def read_index(*paths: Path) -> list[Stage]:
    """Read the stages that one or more indices list, sorted by view.

    The order, and so every sum over the views, does not depend on how the views were dealt out to jobs.

    Raise `InputError` if a file is corrupt or no index, or if two entries are of the same view.
    """
    stages = sorted((_stage(path, row) for path in paths for row in _rows(path)), key=lambda stage: stage.view)
    for view, following in pairwise(stage.view for stage in stages):
        if view == following:
            raise InputError(paths[-1], "view", expected="each view in one index only", found=f"{view!r} twice")
    return stages


def require_result_of(model: str, paths: Sequence[Path]) -> None:
    """Check that indices are of a model, by its digest, and list all views of one measurement.

    Raise `InputError` naming the first index of another model, of other settings or of another device than the first
    index, or of another number of views than all indices list together.
    """
    rows = [(path, row) for path in paths for row in _rows(path)]
    for path, (*_, digest_of_model, settings, device, views) in rows:
        if digest_of_model != model:
            hint = "these contributions are of another model"
            raise InputError(path, "model", expected=model, found=digest_of_model, hint=hint)
        if settings != (expected := rows[0][1][-3]):
            hint = f"not of the views, energy and code of {rows[0][0]}"
            raise InputError(path, "settings", expected=expected, found=settings, hint=hint)
        if device != (expected := rows[0][1][-2]):
            hint = "devices round differently; `snakemake --forcerun measure_contributions` on one device measures all"
            raise InputError(path, "device", expected=expected, found=device, hint=hint)
        if views != str(len(rows)):
            read_index(*paths)  # refuses two indices of one view, the better reason
            hint = "an index is cut, or left out"
            raise InputError(path, "views", expected=f"{views} in all indices", found=str(len(rows)), hint=hint)


def _rows(path: Path) -> list[list[str]]:
    verify(path)
    with reading(path, "an index of contributions"), Path(path).open(encoding="utf-8", newline="") as stream:
        header, *rows = list(csv.reader(stream, delimiter="\t")) or [[]]
    if header != INDEX_COLUMNS or any(len(row) != len(INDEX_COLUMNS) for row in rows):
        raise InputError(path, "columns", expected=" ".join(INDEX_COLUMNS), found=" ".join(header) or "nothing")
    return rows


def _stage(index: Path, row: Sequence[str]) -> Stage:
    view, key, file, *_ = row
    return Stage(view, key, Path(os.path.normpath(index.parent / file)))


def remove_unlisted(folder: Path, indices: Sequence[Path]) -> tuple[int, int]:
    """Delete the stage files below `folder` that none of `indices` lists, with their checksums.

    Return the number of deleted stages and of freed bytes. Raise `InputError` if the indices list none of the stages.
    """
    listed = {stage.path.resolve() for index in indices for stage in read_index(index)}
    arrays = {path.resolve(): path for path in sorted(folder.rglob("*.npy"))}
    unlisted = [arrays[file] for file in arrays.keys() - listed if is_stage(file) and is_result(file)]
    if unlisted and listed.isdisjoint(arrays):
        hint = "to drop every stage, delete the folder"
        raise InputError(folder, "stages", expected=f"some that {indices[0]} or others list", found="none", hint=hint)
    files = [file for stage in unlisted for file in (stage, record_file(stage)) if file.exists()]
    freed = sum(path.stat().st_size for path in files)
    remove(*unlisted)
    return len(unlisted), freed
