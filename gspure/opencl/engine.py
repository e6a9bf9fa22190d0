"""One OpenCL device at work: its context and queue, its built kernels, its reusable buffers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from functools import cache
from typing import Any, Literal

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.artifacts import digest
from gspure.errors import InputError
from gspure.opencl.device import Device
from gspure.opencl.program import build_options, kernel_source

Style = Literal["cpu", "gpu"]
LANES = {"cpu": 16, "gpu": 1}


def suited_style(device: cl.Device) -> Style:
    """Return the kernel style that suits the type of `device`."""
    return "cpu" if device.type & cl.device_type.CPU else "gpu"


def device_digest(device: Device, style: Style | None = None) -> str:
    """Return a digest of driver, device and kernel style (by default the suited one), for keys of stored results.

    Drivers, CPUs and kernel styles round differently: results are bit-identical only where this digest is the same. A
    driver's compiler and the CPU that it targets are part of its version strings.
    """
    target = device.cl_device
    return digest(
        *(device.platform, device.version, device.driver, device.name, target.version.strip()),
        style or suited_style(target),
    )


@cache
def _context(device: cl.Device) -> cl.Context:
    return cl.Context([device])


@cache
def _program(context: cl.Context, sources: tuple[str, ...], defines: tuple[tuple[str, int], ...]) -> cl.Program:
    return cl.Program(context, kernel_source(*sources)).build(options=build_options(dict(defines)))


class Engine:
    """Queue, kernels and buffers of one device; programs are built once per process and shared.

    Parameters
    ----------
    device : pyopencl.Device
        Where to run.
    style : "cpu" or "gpu", optional
        Which of the two kernel styles; by default the one that suits the device's type.

    """

    def __init__(self, device: cl.Device, style: Style | None = None) -> None:
        self.device = device
        self.style: Style = style or suited_style(device)
        self.context = _context(device)
        self.queue = cl.CommandQueue(self.context)
        # On a device that shares the host's memory, mapping such a buffer costs nothing.
        self._flags = cl.mem_flags.READ_WRITE | (cl.mem_flags.ALLOC_HOST_PTR if device.host_unified_memory else 0)
        self._buffers: dict[str, cl.Buffer] = {}
        self._kernels: dict[tuple[Any, ...], dict[str, cl.Kernel]] = {}

    def beside(self) -> Engine:
        """Return an engine of the same device, queue and kernels, with buffers of its own."""
        other = copy(self)
        other._buffers = {}  # noqa: SLF001
        return other

    def kernel(self, name: str, *sources: str, **defines: int) -> cl.Kernel:
        """Return kernel `name` of the program made of `sources` (built once, then kept)."""
        defines = {"LANES": LANES[self.style], **defines}
        key = (sources, tuple(sorted(defines.items())))
        if key not in self._kernels:
            program = _program(self.context, *key)
            self._kernels[key] = {kernel.function_name: kernel for kernel in program.all_kernels()}
        return self._kernels[key][name]

    def run(self, kernel: cl.Kernel, items: int, *args: Any, group: int | None = None) -> None:
        """Enqueue `kernel` over `items` work-items, in groups of `group` (rounded up to whole groups)."""
        group = group or (1 if self.style == "cpu" else 64)
        kernel(self.queue, (-(-items // group) * group,), (group,), *args)

    def buffer(self, name: str, nbytes: int) -> cl.Buffer:
        """Return the buffer kept under `name`, grown to at least `nbytes`; its contents do not survive growing."""
        kept = self._buffers.get(name)
        if kept is None or kept.size < nbytes:
            if kept is not None:
                kept.release()
            self._buffers[name] = kept = self.allocate(nbytes)
        return kept

    def allocate(self, nbytes: int) -> cl.Buffer:
        """Return a new buffer of at least `nbytes`.

        Raises
        ------
        InputError
            The device has no room for it.

        """
        try:
            return cl.Buffer(self.context, self._flags, max(nbytes, 64))
        except cl.Error as error:
            room = f"room for {nbytes / 2**30:.3g} GiB in one piece"
            hint = "smaller images need less"
            raise InputError(self.device.name, "memory", expected=room, found=str(error), hint=hint) from None

    def has(self, name: str) -> bool:
        """Return whether a buffer is kept under `name`."""
        return name in self._buffers

    def uploaded(self, array: NDArray[Any]) -> cl.Buffer:
        """Return a new buffer that holds `array`."""
        buffer = self.allocate(array.nbytes)
        if array.nbytes:
            cl.enqueue_copy(self.queue, buffer, np.ascontiguousarray(array))
        return buffer

    def upload(self, name: str, array: NDArray[Any]) -> cl.Buffer:
        """Copy `array` into the buffer kept under `name`."""
        buffer = self.buffer(name, array.nbytes)
        if array.nbytes:
            cl.enqueue_copy(self.queue, buffer, np.ascontiguousarray(array))
        return buffer

    def clear(self, buffer: cl.Buffer, nbytes: int) -> None:
        """Set the first `nbytes`, a multiple of 4, of `buffer` to zero."""
        if nbytes:
            # PoCL stores pattern by pattern: 16 bytes take a quarter of the time of 4.
            pattern = np.zeros(1 if nbytes % 16 else 4, np.uint32)
            cl.enqueue_fill_buffer(self.queue, buffer, pattern, 0, nbytes)

    @contextmanager
    def mapped(
        self, buffer: cl.Buffer, shape: tuple[int, ...], dtype: Any, *, write: bool = False
    ) -> Iterator[NDArray[Any]]:
        """Yield the head of `buffer` as a host array, valid inside the block only."""
        if 0 in shape:  # OpenCL maps no empty range
            yield np.empty(shape, dtype)
            return
        flags = cl.map_flags.WRITE if write else cl.map_flags.READ
        array, _ = cl.enqueue_map_buffer(self.queue, buffer, flags, 0, shape, dtype)
        try:
            yield array
        finally:
            array.base.release(self.queue)

    def read(self, buffer: cl.Buffer, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
        """Return a copy of the head of `buffer`."""
        array = np.empty(shape, dtype)
        if array.nbytes:
            cl.enqueue_copy(self.queue, array, buffer)
        return array
