"""PyTorch, which is optional: importing this module without it raises `InputError`."""

from collections.abc import Iterator
from contextlib import contextmanager

from gspure.errors import InputError

try:
    import torch
except ImportError as error:
    hint = "pip install gspure[torch]"
    raise InputError("torch", "package", expected="PyTorch", found=str(error), hint=hint) from None

__all__ = ["single_threaded", "torch"]


@contextmanager
def single_threaded() -> Iterator[None]:
    """Let PyTorch use one thread per calling thread in the block, so that its sums do not depend on the cores.

    For small tensors this is also faster.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
