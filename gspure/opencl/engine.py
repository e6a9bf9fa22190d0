"""One OpenCL device: its queue, its built programs and its reusable buffers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from copy import copy
from functools import cache
from threading import RLock, get_ident
from typing import Any, Literal

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from gspure.errors import InputError
from gspure.opencl.buffers import Buffers
from gspure.opencl.device import Device, built, first_line, require_same_process
from gspure.opencl.program import build_options, kernel_source

Style = Literal["cpu", "gpu"]
LANES = {"cpu": 16, "gpu": 1}
_GROUP = {"cpu": 1, "gpu": 64}
_SHORT_OF_MEMORY = {
    cl.status_code.MEM_OBJECT_ALLOCATION_FAILURE,
    cl.status_code.OUT_OF_HOST_MEMORY,
    cl.status_code.OUT_OF_RESOURCES,
}


def suited_style(device: cl.Device) -> Style:
    """Return the kernel style that suits the type of `device`."""
    return "cpu" if device.type & cl.device_type.CPU else "gpu"


def device_identity(device: Device, style: Style | None = None) -> str:
    """Return driver, device and kernel style (by default the suited one) as a text, for keys of stored results.

    Drivers, CPUs and kernel styles round differently, so results are bit-identical only if this text is the same. The
    version strings of a driver name its compiler and the CPU that it targets.
    """
    style = style or suited_style(device.cl_device)
    return "; ".join(
        [
            device.platform,
            device.version,
            device.driver,
            device.name,
            device.cl_device.version.strip(),
            f"{style} style",
        ]
    )


@contextmanager
def _in_memory(device: cl.Device) -> Iterator[None]:
    """Raise `InputError` if the device is short of memory; drivers may allocate buffers only when they are used."""
    try:
        yield
    except cl.Error as error:
        if error.code not in _SHORT_OF_MEMORY:
            raise
        raise _short_of_memory(device, "room for all buffers at once", str(error)) from None


def _short_of_memory(device: cl.Device, needed: str, available: str) -> InputError:
    return InputError(device.name, "memory", expected=needed, found=available, hint="smaller images need less")


@cache
def _context(device: cl.Device) -> cl.Context:
    with _in_memory(device):
        return cl.Context([device])


@cache
def _kernels(
    context: cl.Context, sources: tuple[str, ...], defines: tuple[tuple[str, int], ...], _thread: int
) -> dict[str, cl.Kernel]:
    """Return the kernels of a program by name, built once per process and thread, since kernels hold arguments."""
    try:
        return by_name(built(context, kernel_source(*sources), build_options(dict(defines))))
    except cl.Error as error:
        raise InputError(
            "OpenCL",
            "kernels",
            expected="a driver that builds them",
            found=first_line(str(error)),
            hint="memory may be short",
        ) from None


def by_name(program: cl.Program) -> dict[str, cl.Kernel]:
    """Return the kernels of a built program."""
    return {kernel.function_name: kernel for kernel in program.all_kernels()}


class Program:
    """The kernels of a program, launched in one queue in work-groups of `group` items by default."""

    def __init__(self, kernels: Mapping[str, cl.Kernel], queue: cl.CommandQueue, group: int) -> None:
        self._kernels = kernels
        self._queue = queue
        self._group = group

    def launch(self, name: str, items: int, *args: cl.Buffer | float, group: int | None = None) -> cl.Event | None:
        """Enqueue a kernel over `items` work-items, rounded up to whole groups; return its event, None without items.

        An int is passed as a 32-bit integer, a float as a single-precision number.
        """
        if not items:
            return None
        group = group or self._group
        kernel = _typed(self._kernels[name], tuple(map(type, args)))
        with _in_memory(self._queue.device):
            return kernel(self._queue, (-(-items // group) * group,), (group,), *args)


@cache
def _typed(kernel: cl.Kernel, types: tuple[type, ...]) -> cl.Kernel:
    """Set the argument types of a kernel and return it; pyopencl guesses each by up to five C++ exceptions."""
    kernel.set_scalar_arg_dtypes([{int: np.uint32, float: np.float32}.get(kind) for kind in types])
    return kernel


class Engine:
    """Queue, programs and buffers of one device; programs are built once per process and shared.

    The kernel `style` is by default the one that suits the device's type.
    """

    def __init__(self, device: cl.Device, style: Style | None = None) -> None:
        require_same_process()
        self.device = device
        self._lock = RLock()
        self.style: Style = style or suited_style(device)
        self.context = _context(device)
        with _in_memory(device):
            self.queue = cl.CommandQueue(self.context)
        self.buffers = Buffers(self.allocate, self.copied)
        # On a device that shares the host's memory, mapping such a buffer costs nothing.
        self._flags = cl.mem_flags.READ_WRITE | (cl.mem_flags.ALLOC_HOST_PTR if device.host_unified_memory else 0)

    @contextmanager
    def exclusive(self) -> Iterator[None]:
        """Keep the queue and the buffers from other threads; refuse a forked process."""
        require_same_process()
        with self._lock:
            yield

    def beside(self) -> Engine:
        """Return an engine with the same device, queue and programs, but its own buffers."""
        engine = copy(self)
        engine.buffers = Buffers(engine.allocate, engine.copied)
        return engine

    def program(self, *sources: str, **defines: int) -> Program:
        """Return the program of the named .cl files, concatenated in this order; it is built once."""
        defines = {"LANES": LANES[self.style], **defines}
        kernels = _kernels(self.context, sources, tuple(sorted(defines.items())), get_ident())
        return Program(kernels, self.queue, _GROUP[self.style])

    def vectors(self, count: int) -> int:
        """Return the number of vectors of LANES values that hold `count` values."""
        return -(-count // LANES[self.style])

    def allocate(self, nbytes: int) -> cl.Buffer:
        """Return a new buffer of at least `nbytes`, or raise `InputError` if the device is out of memory."""
        needed = f"room for {nbytes / 2**30:.3g} GiB in one piece"
        device_memory = self.device.global_mem_size
        if nbytes > device_memory:  # drivers may notice only when the buffer is used
            raise _short_of_memory(self.device, needed, f"{device_memory / 2**30:.3g} GiB in all")
        try:
            return cl.Buffer(self.context, self._flags, max(nbytes, 64))
        except cl.Error as error:
            raise _short_of_memory(self.device, needed, str(error)) from None

    def uploaded(self, array: NDArray[Any]) -> cl.Buffer:
        """Return a new buffer that holds `array`."""
        return self.copied(array, self.allocate(array.nbytes))

    def copied(self, array: NDArray[Any], buffer: cl.Buffer) -> cl.Buffer:
        """Copy `array` into `buffer`, and return it."""
        if array.nbytes:
            with _in_memory(self.device):
                cl.enqueue_copy(self.queue, buffer, np.ascontiguousarray(array))
        return buffer

    def clear(self, buffer: cl.Buffer, nbytes: int) -> None:
        """Set the first `nbytes`, a multiple of 4, of `buffer` to zero."""
        if nbytes:
            # PoCL stores pattern by pattern: 16 bytes take a quarter of the time of 4.
            pattern = np.zeros(1 if nbytes % 16 else 4, np.uint32)
            with _in_memory(self.device):
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
        with _in_memory(self.device):
            array, _ = cl.enqueue_map_buffer(self.queue, buffer, flags, 0, shape, dtype)
        if not write:
            array.flags.writeable = False
        try:
            yield array
        finally:
            array.base.release(self.queue)

    @contextmanager
    def reading(self, array: NDArray[Any]) -> Iterator[cl.Buffer]:
        """Yield a buffer over the memory of `array`, for kernels that read it."""
        if not array.size:
            yield self.allocate(0)
            return
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.USE_HOST_PTR
        with _in_memory(self.device):
            buffer = cl.Buffer(self.context, flags, hostbuf=np.ascontiguousarray(array))
            yield buffer
            self.queue.finish()
        buffer.release()

    @contextmanager
    def writing(self, array: NDArray[Any]) -> Iterator[cl.Buffer]:
        """Yield a buffer over the memory of `array`, for kernels that write all of it."""
        if not array.size:
            yield self.allocate(0)
            return
        flags = cl.mem_flags.WRITE_ONLY | cl.mem_flags.USE_HOST_PTR
        with _in_memory(self.device):
            buffer = cl.Buffer(self.context, flags, hostbuf=array)
            yield buffer
            mapped, _ = cl.enqueue_map_buffer(self.queue, buffer, cl.map_flags.READ, 0, array.shape, array.dtype)
        mapped.base.release(self.queue)
        buffer.release()

    def read(self, buffer: cl.Buffer, shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
        """Return a copy of the head of `buffer`."""
        array = np.empty(shape, dtype)
        if array.nbytes:
            with _in_memory(self.device):
                cl.enqueue_copy(self.queue, array, buffer)
        return array
