"""The kind of machine that is measured on: enough to read the numbers, nothing that identifies it."""

from __future__ import annotations

import os
import platform
import re
from pathlib import Path

import numpy as np
from timing import CORES

from gspure.opencl.device import Device


def describe(device: Device) -> dict[str, str]:
    """Return what a reader of the results needs to know."""
    other = os.environ.get("POCL_LLVM_CPU_NAME")
    return {
        "processor": _processor(),
        "cores": str(CORES),
        "memory": f"{os.sysconf('SC_PHYS_PAGES') * os.sysconf('SC_PAGE_SIZE') / 2**30:.0f} GiB",
        "load before": f"{os.getloadavg()[0]:.1f}",
        "OpenCL device": device.name,
        "OpenCL driver": f"{device.platform} {device.driver}",
        "kernels compiled for": f"{other}, but run on the processor above" if other else "this processor",
        "software": f"{platform.system()}, Python {platform.python_version()}, numpy {np.__version__}",
    }


def _processor() -> str:
    listing = Path("/proc/cpuinfo")
    if not listing.exists():
        return platform.processor() or platform.machine()
    fields = dict(re.findall(r"^([^\t:]+?)\s*: (.*)$", listing.read_text(encoding="utf-8"), re.MULTILINE))
    widest = next((f for f in ("avx512f", "avx2", "avx") if f in fields.get("flags", "").split()), "no AVX")
    model = fields.get("model name", platform.machine())
    return f"{model}, family {fields.get('cpu family', '?')}, model {fields.get('model', '?')}, {widest}"
