"""PyTorch, which is optional, and the device that it computes on: CUDA if it works, else the CPU.

Importing this module without PyTorch raises `InputError`.
"""

import ctypes
import io
import os
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from gspure.errors import InputError
from gspure.progress import warn

try:
    import torch
except ImportError as error:
    hint = "pip install 'gspure[torch]'"
    raise InputError("torch", "package", expected="PyTorch", found=str(error), hint=hint) from None

_M_TRIM_THRESHOLD = -1  # malloc.h
_M_MMAP_THRESHOLD = -3
_GIB = 1 << 30

__all__ = [
    "BFLOAT16",
    "DEVICE",
    "keep_freed_memory",
    "on_device",
    "on_host",
    "read_tensors",
    "single_threaded",
    "torch",
]


def _working_device() -> torch.device:
    """Return CUDA, with sums in a fixed order, unless it is missing or a trial fails, as with an old driver or card."""
    if torch.cuda.is_available():
        os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # for the same bits in every run
        try:
            image = torch.ones(1, 1, 4, 4, device="cuda", requires_grad=True)
            torch.nn.functional.conv2d(image, torch.ones(1, 1, 3, 3, device="cuda")).sum().backward()
            (image.grad[0, 0] @ image[0, 0]).sum().item()
        except RuntimeError as error:
            warn(f"PyTorch uses the CPU, as CUDA failed: {str(error).splitlines()[0]}")
        else:
            torch.use_deterministic_algorithms(mode=True)
            return torch.device("cuda")
    return torch.device("cpu")


DEVICE: Final = _working_device()
BFLOAT16: Final = DEVICE.type == "cpu" and torch.cpu._is_avx512_bf16_supported()  # noqa: SLF001  (nothing public in 2.6)
"""Whether training multiplies in bfloat16, at twice the speed; sums, parameters and their moments have 32 bits."""


def on_device(array: NDArray[Any]) -> torch.Tensor:
    """Return an array as a tensor on the device; on the CPU, they share their memory."""
    return torch.from_numpy(array).to(DEVICE)


def on_host(tensor: torch.Tensor) -> NDArray[Any]:
    """Return a tensor as an array, without its history; on the CPU, they share their memory."""
    array: NDArray[Any] = tensor.detach().cpu().numpy()
    return array


def read_tensors(source: Path, content: bytes) -> dict[str, torch.Tensor]:
    """Return the state dict that a file holds, or raise `InputError`; no code in it is executed."""
    state = None
    with suppress(Exception):  # a corrupt or hostile file raises almost any kind
        members = zipfile.ZipFile(io.BytesIO(content)).infolist()
        if sum(member.file_size for member in members) < len(content):  # not compressed, which bounds its memory
            state = torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
    if not isinstance(state, dict) or not all(isinstance(tensor, torch.Tensor) for tensor in state.values()):
        kind = "another file; nothing in it was executed"
        raise InputError(source, "file", expected="a state dict of PyTorch", found=kind)
    return {str(name): tensor for name, tensor in state.items()}


@contextmanager
def single_threaded() -> Iterator[None]:
    """Let PyTorch use one thread per calling thread in the block, so that its sums do not depend on the cores.

    For small tensors this is also faster.
    """
    keep_freed_memory()
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def keep_freed_memory() -> None:
    """Let glibc keep freed tensors: it returns them to the system, and page faults then take a quarter of a step."""
    if os.name != "posix":
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt and mallopt(_M_MMAP_THRESHOLD, _GIB):
        mallopt(_M_TRIM_THRESHOLD, _GIB)
