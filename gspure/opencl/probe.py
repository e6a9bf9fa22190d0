"""Every OpenCL device tried in a process of its own, since a broken driver may kill the process that uses it.

``python -m gspure.opencl.probe`` prints the devices as JSON, ``python -m gspure.opencl.probe INDEX`` tries one of them.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Final

_SECONDS: Final = 60
# A kernel from the driver's cache would hide a compiler or linker that no longer works.
_UNCACHED: Final = {"POCL_KERNEL_CACHE": "0"}


@dataclass(frozen=True)
class Trial:
    """What became of a trivial program on one device.

    Parameters
    ----------
    index, kind, name, platform, driver
        As in `gspure.opencl.device.Device`.
    meant : bool
        Whether the environment variable GSPURE_DEVICE admits it.
    fault : str or None
        Why the program did not build and run; None if it did.
    seconds : float
        Time from nothing to its result: the start of Python, the driver, the build and the run.

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
    seconds = time.monotonic() - began
    return Trial(**device, fault=_fault(child), seconds=seconds)


def _fault(child: subprocess.CompletedProcess[str]) -> str | None:
    if child.returncode == 0:
        return None
    reasons = [line.strip() for line in child.stderr.splitlines() if "error" in line.casefold()]
    died = f"the driver ended the process (status {child.returncode})"
    return reasons[0].removeprefix("error: ") if reasons else died


def _child(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gspure.opencl.probe", *arguments]
    try:
        return subprocess.run(
            command, capture_output=True, text=True, check=False, timeout=_SECONDS, env=os.environ | _UNCACHED
        )
    except subprocess.TimeoutExpired:
        return subprocess.CompletedProcess(command, 1, "", f"error: no answer within {_SECONDS} s")


def _main(arguments: list[str]) -> str | None:
    from gspure.opencl.device import fault, list_devices

    if arguments:
        reason = fault(list_devices()[int(arguments[0])])
        return reason and f"error: {reason.removeprefix('error: ')}"
    print(json.dumps(_listing()))  # noqa: T201
    return None


def _listing() -> list[dict[str, Any]]:
    from gspure.errors import InputError
    from gspure.opencl.device import devices_meant, list_devices

    try:
        meant = devices_meant()
    except InputError:
        meant = ()
    fields = ("index", "kind", "name", "platform", "driver")
    return [{f: getattr(device, f) for f in fields} | {"meant": device in meant} for device in list_devices()]


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1:]))
