"""Per-view contributions on disk; a view is computed again only if its inputs change.

A cached view is one file, ``{view}.{key}.npy``. Its key is a digest of all inputs of the computation, so an edited
camera, model or kernel leads to another file, and no file is stale. A file that cannot be read counts as missing. An
index, which each job writes last, lists the cached views of a part.
"""

import os
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import gspure.opencl
import gspure.renderer
from gspure.arrays import load_array, save_array
from gspure.cameras import Camera
from gspure.constants import Energy
from gspure.errors import InputError
from gspure.files import digest, read_json, write_json
from gspure.model import require_finite
from gspure.opencl.device import Device, choose_device
from gspure.opencl.engine import device_identity
from gspure.opencl.program import kernel_digest
from gspure.progress import say, track
from gspure.public_model import PublicModel
from gspure.renderer import CONTRIBUTION


def contribute(
    public: PublicModel,
    cameras: Sequence[Camera],
    folder: Path,
    *,
    device: Device | None = None,
    energy: Energy = "ray",
) -> dict[str, Path]:
    """Compute the contributions of `public` to every view, except those stored in `folder`; return the files by view.

    Views have unique names. The model is uploaded and the kernels are built once, and only if a view is computed. Raise
    `InputError` if the model holds a number that is not finite.
    """
    require_finite(public.model, "model")
    device = device or choose_device()
    geometry = digest(public.geometry_digest(), *(file.read_bytes() for file in public.code))
    driver = device_identity(device)
    keys = {camera.name: contribution_key(geometry, camera, energy, driver) for camera in cameras}
    files = {view: folder / f"{view}.{key}.npy" for view, key in keys.items()}
    missing = [camera for camera in cameras if not _is_readable(files[camera.name])]
    if missing:
        contributions = public.contributions(device, energy)
        for camera in track(missing, "contributions"):
            save_array(files[camera.name], contributions(camera))
    stored = len(files) - len(missing)
    say(f"contributions: {len(missing)} of {len(files)} views computed, {stored} already stored")
    return files


def contribution_key(geometry: str, camera: Camera, energy: str, device: str) -> str:
    """Return the key of one view's contributions, a digest of all inputs of their computation.

    `geometry` is a digest of the model and of the code that computes its Gaussians, `device` a name
    (`gspure.opencl.engine.device_identity`). The key depends on the camera's numbers, not on its name.
    """
    return digest(geometry, camera.numbers, energy, rendering_digest(), device)


@cache
def rendering_digest() -> str:
    """Return a digest of the kernels, constants and host code of rendering."""
    host_code = [Path(gspure.renderer.__file__), *sorted(Path(gspure.opencl.__path__[0]).glob("*.py"))]
    return digest(kernel_digest(), *(path.read_bytes() for path in host_code))


def _is_readable(path: Path) -> bool:
    try:
        read_contributions(path)
    except InputError:
        return False
    return True


def read_contributions(path: Path, count: int | None = None) -> NDArray[Any]:
    """Read one cached view: an array of `gspure.renderer.CONTRIBUTION` over the touched rows, sorted by index.

    Raise `InputError` if the file is missing or corrupt, its rows do not ascend, or a row is beyond the `count` rows of
    the model.
    """
    touched = load_array(path, dtype=CONTRIBUTION, shape=(None,))
    if (np.diff(touched["index"].astype(np.int64)) <= 0).any():
        raise InputError(path, "index", expected="ascending rows", found="others")
    if count is not None and len(touched):
        last = int(touched["index"][-1])
        if last >= count:
            raise InputError(path, "index", expected=f"rows 0 to {count - 1} of the model", found=f"row {last}")
    return touched


def write_index(path: Path, files: Mapping[str, Path]) -> None:
    """Write the cached `files` by view, relative to the index, so that a project can be moved."""
    write_json(path, {view: os.path.relpath(file, path.parent) for view, file in files.items()})


def read_index(*paths: Path) -> list[Path]:
    """Read the cached files that one or more indices list, sorted by view.

    The order, and so every sum over the views, does not depend on the distribution of the views to jobs.
    """
    files = {view: path.parent / file for path in paths for view, file in read_json(path).items()}
    return [files[view] for view in sorted(files)]
