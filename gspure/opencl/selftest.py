"""Test of every OpenCL device on a small frame in a separate process, since a broken driver may end its process.

Without arguments, ``python -m gspure.opencl.selftest`` prints the devices as JSON; with an index it tries that device.
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

if TYPE_CHECKING:  # imported in children only, so that `gspure doctor` reports missing packages
    from gspure.opencl.device import Device

_SECONDS: Final = 20
_REASON: Final = re.compile(r"^(?:error: *(.*)|(?:\w+\.)*(\w*Error: .*))", re.MULTILINE)


@dataclass(frozen=True)
class Trial:
    """The result of a trivial program and a small frame on one device (`gspure.opencl.device.Device`).

    `selected` is true if the device matches the environment variable GSPURE_DEVICE; `problem` says why it does not
    work. `seconds` to the frame include the start of Python and of the driver, and the builds.
    """

    index: int
    kind: str
    name: str
    platform: str
    driver: str
    selected: bool
    problem: str | None
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
    problem = None
    if child.returncode:
        reason = _REASON.search(child.stderr)
        problem = reason[1] or reason[2] if reason else f"the driver ended the process (status {child.returncode})"
    return Trial(**device, problem=problem, seconds=time.monotonic() - began)


def _child(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gspure.opencl.selftest", *arguments]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=_SECONDS)
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(command, 1, "", f"error: no answer within {_SECONDS} s")


def _main(arguments: list[str]) -> str | None:
    """List the devices, or test one of them and return its problem."""
    from gspure.opencl.device import list_devices, matching_devices

    devices = list_devices()
    if arguments:
        problem = frame_problem(devices[int(arguments[0])])
        return problem and f"error: {problem.removeprefix('error: ')}"
    try:
        selected = matching_devices()
    except InputError:
        selected = ()
    fields = ("index", "kind", "name", "platform", "driver")
    listing = [{f: getattr(d, f) for f in fields} | {"selected": d in selected} for d in devices]
    print(json.dumps(listing))  # noqa: T201
    return None


def frame_problem(device: Device) -> str | None:
    """Return why a trivial program or a small frame is wrong on `device`; None if both are correct.

    A frame is correct if its contributions add up to the light that is absorbed from the background.
    """
    import numpy as np

    from gspure.cameras import Camera, intrinsics
    from gspure.model import Gaussians
    from gspure.opencl.device import defect
    from gspure.opencl.engine import Engine
    from gspure.opencl.frame import Frame, Traversal
    from gspure.opencl.passes import forward
    from gspure.opencl.storage import store

    problem = defect(device, factor=3 + os.getpid() % 1000)
    if problem:
        return problem
    rng = np.random.default_rng(0)
    count = 64
    size = 48
    model = Gaussians.from_parameters(
        means=rng.uniform((-1, -1, 3), (1, 1, 5), (count, 3)),
        quats=rng.normal(size=(count, 4)),
        scales=rng.uniform(0.05, 0.2, (count, 3)),
        opacities=rng.uniform(0.1, 0.9, count),
        sh_coeffs=np.zeros((count, 1, 3)),
    )
    camera = Camera("trial", size, size, intrinsics(size, size, size / 2, size / 2), np.eye(4))
    engine = Engine(device.cl_device)
    frame = Frame(engine, store(engine, model), camera, Traversal("ray", contributions=True))
    canvas = forward(frame).canvas
    contributed = float(engine.read(canvas.records, (count, 4), np.float32)[:, 1].sum(dtype=float))
    absorbed = float((1 - engine.read(canvas.transmittance, (size, size), np.float32)).sum(dtype=float))
    is_correct = absorbed > 1 and abs(contributed - absorbed) < 1e-4 * absorbed
    return None if is_correct else "a small frame gives wrong results"


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1:]))
