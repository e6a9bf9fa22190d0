"""PyTorch, which schemes with networks need and all else does without; whoever imports this without it is told so."""

from collections.abc import Iterator
from contextlib import contextmanager

from gspure.errors import InputError
from gspure.schemes.scheme import PYTORCH

try:
    import torch
except ImportError as error:
    hint = f"pip install {PYTORCH['torch']}"
    raise InputError("torch", "package", expected="PyTorch", found=str(error), hint=hint) from None

__all__ = ["single_threaded", "torch"]


@contextmanager
def single_threaded() -> Iterator[None]:
    """Let PyTorch use one thread per calling thread in the block: its sums do not depend on how many cores there are.

    Over tensors as small as these it is also faster: its threads would mostly wait for each other.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
