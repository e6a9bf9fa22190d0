"""Per-view contributions on disk; a view is computed again only if its inputs change.

A cached view is one file, ``{view}.{key}.npy``. Its key is a digest of everything that its numbers depend on, so an
edited camera, model or kernel gives another file, and none is stale. A file that cannot be read counts as missing. An
index (one .tsv per job, written last) lists the cached views of a part.
"""

import csv
import io
import os
from collections.abc import Iterable, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import gspure.opencl
import gspure.renderer
from gspure.cameras import Camera
from gspure.errors import InputError, reading
from gspure.files import digest, load_array, save_array, write_text
from gspure.model import require_finite
from gspure.opencl.device import Device, choose_device
from gspure.opencl.engine import device_identity
from gspure.opencl.frame import Energy
from gspure.opencl.program import kernel_digest
from gspure.progress import say, track
from gspure.public_model import PublicModel
from gspure.renderer import CONTRIBUTION


class CachedView(NamedTuple):
    """The stored contributions of one view: which view, and its file."""

    view: str
    path: Path


def contribute(
    public: PublicModel,
    cameras: Sequence[Camera],
    folder: Path,
    *,
    device: Device | None = None,
    energy: Energy = "ray",
) -> list[CachedView]:
    """Compute the contributions of `public` to every view, except those stored in `folder`.

    Views have unique names. The model is uploaded and the kernels are built once, and only if a view is computed. Raise
    `InputError` if the model holds a number that is not finite.
    """
    require_finite(public.model, "model")
    device = device or choose_device()
    geometry = digest(public.geometry_digest(), *(file.read_bytes() for file in public.code))
    keys = [contribution_key(geometry, camera, energy, device_identity(device)) for camera in cameras]
    views = [CachedView(c.name, folder / f"{c.name}.{key}.npy") for c, key in zip(cameras, keys, strict=True)]
    missing = [pair for pair in zip(cameras, views, strict=True) if not _is_readable(pair[1].path)]
    if missing:
        contributions = public.contributions(device, energy)
        for camera, view in track(missing, "contributions"):
            save_array(view.path, contributions(camera))
    computed = f"{len(missing)} of {len(views)} views computed"
    say(f"contributions: {computed}, {len(views) - len(missing)} already stored")
    return views


def contribution_key(geometry: str, camera: Camera, energy: str, device: str) -> str:
    """Return the key of one view's contributions, a digest of everything that they depend on.

    `geometry` is a digest of the model and of the code that computes its Gaussians, `device` a name
    (`gspure.opencl.engine.device_identity`). The camera's numbers count, not its name.
    """
    return digest(geometry, camera.numbers, energy, rendering_digest(), device)


@cache
def rendering_digest() -> str:
    """Return a digest of the kernels, constants and host code of rendering."""
    host = [Path(gspure.renderer.__file__), *sorted(Path(gspure.opencl.__path__[0]).glob("*.py"))]
    return digest(kernel_digest(), *(path.read_bytes() for path in host))


def _is_readable(path: Path) -> bool:
    try:
        read_contributions(path)
    except InputError:
        return False
    return True


def read_contributions(path: Path, count: int | None = None) -> NDArray[Any]:
    """Read one cached view: an array of `gspure.renderer.CONTRIBUTION` over the touched rows, sorted by index.

    Raise `InputError` if the file is missing or corrupt, its rows do not ascend, or it names a row that a model of
    `count` rows does not have.
    """
    touched = load_array(path, dtype=CONTRIBUTION, shape=(None,))
    if (np.diff(touched["index"].astype(np.int64)) <= 0).any():
        raise InputError(path, "index", expected="ascending rows", found="others")
    if count is not None and len(touched) and (last := int(touched["index"][-1])) >= count:
        raise InputError(path, "index", expected=f"rows 0 to {count - 1} of the model", found=f"row {last}")
    return touched


def write_index(path: Path, views: Iterable[CachedView]) -> None:
    """Write the list of `views`; their paths are stored relative to the index, so that a project can be moved."""
    text = io.StringIO()
    table = csv.writer(text, delimiter="\t", lineterminator="\n")
    table.writerow(CachedView._fields)
    table.writerows((view, os.path.relpath(file, path.parent)) for view, file in views)
    write_text(path, text.getvalue())


def read_index(*paths: Path) -> list[CachedView]:
    """Read the cached views that one or more indices list, sorted by view.

    The order, and so every sum over the views, does not depend on how the views were dealt out to jobs. Raise
    `InputError` if a file is no index, or if two entries are of the same view.
    """
    views = sorted(view for path in paths for view in _listed(path))
    for view, following in pairwise(name for name, _ in views):
        if view == following:
            raise InputError(paths[-1], "view", expected="each view in one index only", found=f"{view!r} twice")
    return views


def _listed(path: Path) -> list[CachedView]:
    with reading(path, "an index of contributions"), Path(path).open(encoding="utf-8", newline="") as stream:
        header, *rows = list(csv.reader(stream, delimiter="\t")) or [[]]
    if header != [*CachedView._fields] or any(len(row) != len(header) for row in rows):
        raise InputError(path, "columns", expected=" ".join(CachedView._fields), found=" ".join(header) or "nothing")
    return [CachedView(view, Path(os.path.normpath(path.parent / file))) for view, file in rows]
