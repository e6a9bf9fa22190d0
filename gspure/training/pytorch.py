"""PyTorch, which is optional: importing this module without it raises `InputError`."""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager

from gspure.errors import InputError

try:
    import torch
except ImportError as error:
    hint = "pip install gspure[torch]"
    raise InputError("torch", "package", expected="PyTorch", found=str(error), hint=hint) from None

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # malloc.h
_GIB = 1 << 30

__all__ = ["single_threaded", "torch"]


@contextmanager
def single_threaded() -> Iterator[None]:
    """Let PyTorch use one thread per calling thread in the block, so that its sums do not depend on the cores.

    For small tensors this is also faster.
    """
    _keep_freed_memory()
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _keep_freed_memory() -> None:
    """Let the C library reuse the memory of freed tensors.

    By default, glibc returns it to the system, and a step spends a quarter of its time on faults of fresh pages.
    """
    if os.name == "posix" and (mallopt := getattr(ctypes.CDLL(None), "mallopt", None)):
        _ = mallopt(_M_MMAP_THRESHOLD, _GIB) and mallopt(_M_TRIM_THRESHOLD, _GIB)
