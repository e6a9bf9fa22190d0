"""OpenCL devices: listed, tested, chosen."""

import atexit
import ctypes
import os
import shutil
import tempfile
import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Final, Literal

import numpy as np
import pyopencl as cl

from gspure.errors import InputError
from gspure.files import digest, replacing
from gspure.progress import warn

DEVICE_VARIABLE: Final = "GSPURE_DEVICE"
POCL: Final = "Portable Computing Language"
INSTALL_HINT: Final = "see `gspure doctor`, which installs a driver with --fix"

_TRIVIAL_KERNEL = """
kernel void scale(global const float16 *input, global float16 *output) {
    const size_t i = get_global_id(0);
    output[i] = FACTOR * input[i] + 1.0f;
}
"""


@cache
def _process() -> int:
    """Return the process that uses OpenCL: the first one to ask."""
    return os.getpid()


def require_same_process() -> None:
    """Raise `InputError` in a process that was forked from one that used OpenCL: drivers would wait forever."""
    if os.getpid() != _process():
        hint = "start processes by `spawn`: multiprocessing.set_start_method"
        raise InputError("OpenCL", "process", expected="the one that used it first", found="a fork of it", hint=hint)


@dataclass(frozen=True)
class Device:
    """One OpenCL device of this machine, as its driver reports it; `version` is the platform's.

    `index` is its place in `list_devices`, stable as long as the installed drivers stay the same. Everything but a GPU
    counts as a CPU.
    """

    index: int
    kind: Literal["cpu", "gpu"]
    name: str
    platform: str
    version: str
    driver: str
    cl_device: cl.Device

    def __str__(self) -> str:
        return f"{self.index}: {self.name} ({self.platform})"


@cache
def list_devices() -> tuple[Device, ...]:
    """Return every device of every platform, GPUs first."""
    require_same_process()
    by_kind = sorted((d for p in _platforms() for d in _devices(p)), key=lambda d: not d.type & cl.device_type.GPU)
    return tuple(
        Device(
            index=index,
            kind="gpu" if device.type & cl.device_type.GPU else "cpu",
            name=device.name.strip(),
            platform=device.platform.name.strip(),
            version=device.platform.version.strip(),
            driver=device.driver_version.strip(),
            cl_device=device,
        )
        for index, device in enumerate(by_kind)
    )


def matching_devices(spec: str | None = None) -> tuple[Device, ...]:
    """Return the devices that match `spec`, or else the environment variable GSPURE_DEVICE, or else all.

    `spec` is an index, or a part of the name of the device or platform, or of its version ("pocl"), in any case. Raise
    `InputError` if no device matches.
    """
    require_same_process()
    devices = list_devices()
    spec = spec or os.environ.get(DEVICE_VARIABLE)
    if not spec:
        return devices
    if spec.isdecimal():
        matching = devices[int(spec) :][:1]
    else:
        matching = tuple(d for d in devices if spec.casefold() in f"{d.name}\n{d.platform}\n{d.version}".casefold())
    if not matching:
        listed = "; ".join(map(str, devices)) or "no device"
        hint = None if devices else INSTALL_HINT
        raise InputError("OpenCL", "device", expected=f"one that matches {spec!r}", found=listed, hint=hint)
    return matching


@cache
def defect(device: Device, factor: int = 3) -> str | None:
    """Return why a trivial program fails to build or run on `device`; None if it works.

    A driver may end the process instead of reporting an error; `gspure.opencl.selftest` survives that.

    `factor` is a multiplier in the program. With a new one, the driver compiles even if it has a cache.
    """
    numbers = np.arange(64, dtype=np.float32)
    scaled = np.empty_like(numbers)
    try:
        context = cl.Context([device.cl_device])
        queue = cl.CommandQueue(context)
        source = cl.Buffer(context, cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR, hostbuf=numbers)
        target = cl.Buffer(context, cl.mem_flags.WRITE_ONLY, size=scaled.nbytes)
        program = built(context, _TRIVIAL_KERNEL, [f"-DFACTOR={factor}.0f"], cached=False)
        cl.Kernel(program, "scale")(queue, (numbers.size // 16,), None, source, target)
        cl.enqueue_copy(queue, scaled, target)
    except cl.Error as error:
        return first_line(str(error))
    return None if np.array_equal(scaled, factor * numbers + 1) else "a trivial program gives wrong results"


def built(context: cl.Context, source: str, options: Sequence[str], *, cached: bool = True) -> cl.Program:
    """Build a program, without the warnings of the driver's compiler: some drivers always warn.

    PoCL loads a program from its own cache in 20 ms, and from a binary in 2 ms. Making a binary takes as long as the
    build, so only programs that are built a second time are stored as binaries.

    Raise MemoryError if the driver runs out of memory. PoCL would hang on the release of that program, so it is never
    released.
    """
    device = context.devices[0]
    file = _binary(device, source, options) if cached and device.platform.name == POCL else None
    binary = file.read_bytes() if file and file.is_file() else None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cl.CompilerWarning)
        try:
            if binary:
                with suppress(cl.Error):  # another PoCL of the same version
                    return cl.Program(context, [device], [binary]).build(list(options))
            program = cl.Program(context, source).build(list(options), cache_dir=None if cached else False)
            content = b"" if binary is None else program.binaries[0]
        except MemoryError as error:
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(error))  # its traceback refers to the program
            raise MemoryError("no room to build the kernels") from None
    if file:
        with suppress(OSError), replacing(file) as temporary:
            temporary.write_bytes(content)
    return program


def _binary(device: cl.Device, source: str, options: Sequence[str]) -> Path:
    """Return the path of a program's binary; the file is empty after the first build."""
    cache = os.environ.get("POCL_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    driver = (device.platform.version, device.driver_version, device.name, device.version)
    return Path(cache).expanduser() / "gspure" / f"{digest(*driver, source, *options)}.bin"


def works(device: Device) -> bool:
    """Return whether a trivial program builds and runs on `device`."""
    return defect(device) is None


def choose_device(spec: str | None = None) -> Device:
    """Return the first device of `matching_devices` that works, GPUs before CPUs.

    A device that was asked for is not replaced by another one. Raise `InputError` if no matching device works.
    """
    matching = matching_devices(spec)
    for device in matching:
        if works(device):
            return device
    raise InputError(
        "OpenCL",
        "device",
        expected="a device on which a trivial program builds and runs",
        found="; ".join(f"{device}: {defect(device)}" for device in matching) or "no device",
        hint=INSTALL_HINT,
    )


def _platforms() -> list[cl.Platform]:
    _redirect_caches()
    _register_intel()
    try:
        platforms: list[cl.Platform] = cl.get_platforms()
    except cl.Error:  # the loader found no driver
        return []
    # PoCL 3.0, that of PyPI, hangs or ends the process on processors made since 2022.
    return sorted(platforms, key=lambda platform: "PoCL 3.0" in platform.version)


def _redirect_caches() -> None:
    """Replace read-only folders of kernel caches by temporary ones; otherwise, PoCL lists no device."""
    for variable, default in {"XDG_CACHE_HOME": "~/.cache", "POCL_CACHE_DIR": None}.items():
        place = os.environ.get(variable) or default
        if not place:
            continue
        try:
            folder = Path(place).expanduser()
            folder.mkdir(parents=True, exist_ok=True)
            writable = os.access(folder, os.W_OK)
        except (OSError, RuntimeError):  # a user without a home
            writable = False
        if not writable:
            temporary = tempfile.mkdtemp(prefix="gspure-cache-")
            os.environ[variable] = temporary
            atexit.register(shutil.rmtree, temporary, ignore_errors=True)
            warn(f"{place} cannot be written to: this process caches its kernels in a temporary folder")


def _register_intel() -> None:
    """Register Intel's runtime from PyPI with the OpenCL loader, beside all other drivers; its package does not."""
    try:
        files = metadata.files("intel-opencl-rt") or []
    except metadata.PackageNotFoundError:
        return
    library = next((str(Path(file.locate()).resolve()) for file in files if file.name == "libintelocl.so"), None)
    if not library or {"OCL_ICD_VENDORS", "OPENCL_VENDOR_PATH"} & os.environ.keys():
        return
    folder = Path(tempfile.mkdtemp(prefix="gspure-drivers-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    for place in (Path("/etc/OpenCL/vendors"), Path(cl.__file__).with_name(".libs")):
        for file in place.glob("*.icd"):
            (folder / file.name).symlink_to(file)
    (folder / "intel-pypi.icd").write_text(library)
    os.environ["OCL_ICD_VENDORS"] = str(folder)


def _devices(platform: cl.Platform) -> list[cl.Device]:
    try:
        return list(platform.get_devices())
    except cl.Error:  # a driver without its hardware
        return []


def first_line(message: str) -> str:
    """Return the first line of a driver's message with "error", else its first line."""
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    first = lines[0] if lines else "unknown error"
    return next((line for line in lines if "error" in line.casefold()), first)
