"""Fixtures that several test files share: each OpenCL device that works here, kernel style, energy."""

import os
from pathlib import Path

# Compiled kernels are kept between test runs, apart from the user's own; PoCL reads this when it is loaded.
os.environ.setdefault("POCL_CACHE_DIR", str(Path(__file__).parents[1] / ".pytest_cache" / "pocl"))

import pytest

from gspure.opencl.device import list_devices, works


@pytest.fixture(params=filter(works, list_devices()), ids=str, scope="session")
def device(request):
    return request.param


@pytest.fixture(params=["cpu", "gpu"])
def style(request):
    return request.param


@pytest.fixture(params=["ewa", "ray"])
def energy(request):
    return request.param
