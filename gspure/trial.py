"""Every OpenCL device tried on a small frame, in a process of its own: a broken driver may end the process it is in.

``python -m gspure.trial`` prints the devices as JSON, ``python -m gspure.trial INDEX`` tries one of them.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from gspure.errors import InputError

if TYPE_CHECKING:  # nothing else is imported before a child needs it, so that `gspure doctor` can tell what is missing
    from gspure.cameras import Camera
    from gspure.model import Gaussians
    from gspure.opencl.device import Device

_SECONDS: Final = 120
_TOLD: Final = re.compile(r"^(?:error: *(.*)|(?:\w+\.)*(\w*Error: .*))", re.MULTILINE)


@dataclass(frozen=True)
class Trial:
    """What became of a trivial program and of a small frame on one device.

    Parameters
    ----------
    index, kind, name, platform, driver
        As in `gspure.opencl.device.Device`.
    meant : bool
        Whether the environment variable GSPURE_DEVICE admits it.
    fault : str or None
        Why it will not do; None if it will.
    seconds : float
        Time from nothing to the frame: the start of Python, the driver, the builds, the runs.

    """

    index: int
    kind: str
    name: str
    platform: str
    driver: str
    meant: bool
    fault: str | None
    seconds: float


def try_devices() -> list[Trial]:
    """Return one trial per OpenCL device, in the order of `gspure.opencl.device.list_devices`."""
    listing = _child()
    devices: list[dict[str, Any]] = json.loads(listing.stdout) if listing.returncode == 0 else []
    with ThreadPoolExecutor() as pool:
        return list(pool.map(_try, devices))


def _try(device: dict[str, Any]) -> Trial:
    began = time.monotonic()
    child = _child(str(device["index"]))
    return Trial(**device, fault=_fault(child), seconds=time.monotonic() - began)


def _fault(child: subprocess.CompletedProcess[str]) -> str | None:
    if child.returncode == 0:
        return None
    told = _TOLD.search(child.stderr)
    return told[1] or told[2] if told else f"the driver ended the process (status {child.returncode})"


def _child(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gspure.trial", *arguments]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=_SECONDS)
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(command, 1, "", f"error: no answer within {_SECONDS} s")


def _main(arguments: list[str]) -> str | None:
    """Do what a child does; the message of a failure."""
    from gspure.opencl.device import list_devices

    if not arguments:
        print(json.dumps(_listing()))  # noqa: T201
        return None
    fault = frame_fault(list_devices()[int(arguments[0])])
    return fault and f"error: {fault.removeprefix('error: ')}"


def _listing() -> list[dict[str, Any]]:
    from gspure.opencl.device import list_devices, matching_devices

    try:
        meant = matching_devices()
    except InputError:
        meant = ()
    fields = ("index", "kind", "name", "platform", "driver")
    return [{f: getattr(device, f) for f in fields} | {"meant": device in meant} for device in list_devices()]


def frame_fault(device: Device) -> str | None:
    """Return why a trivial program and then a small frame do not come out right on `device`; None if they do.

    The frame is right when what the Gaussians contribute is what they take from the background: sum_k omega_k =
    sum over pixels of (1 - T).
    """
    from gspure.opencl.device import fault
    from gspure.renderer import Renderer

    if trivial := fault(device, factor=3 + os.getpid() % 1000):
        return trivial
    model, camera = _small_scene()
    renderer = Renderer(model, device, energy="ray")
    given = float(renderer.contributions(camera)["sum"].sum(dtype=float))
    taken = float((1 - renderer.transmittance(camera)).sum(dtype=float))
    return None if taken > 1 and abs(given - taken) < 1e-4 * taken else "a small frame gives wrong results"


def _small_scene() -> tuple[Gaussians, Camera]:
    import numpy as np

    from gspure.cameras import Camera, intrinsics
    from gspure.model import Gaussians

    rng, count = np.random.default_rng(0), 64
    model = Gaussians.from_parameters(
        means=rng.uniform(-1, 1, (count, 3)),
        quats=rng.normal(size=(count, 4)),
        scales=rng.uniform(0.05, 0.2, (count, 3)),
        opacities=rng.uniform(0.1, 0.9, count),
        sh_coeffs=rng.normal(size=(count, 1, 3)),
    )
    viewmat = np.eye(4)
    viewmat[2, 3] = 4
    return model, Camera("trial", 48, 48, intrinsics(48, 48, 24, 24), viewmat)


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1:]))
