"""PyTorch's "cuda", where there is none: the device that PyTorch has."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import Any, Final

from gspure_torch.pytorch import DEVICE, keep_freed_memory, torch

_IDLE: Final = (
    "set_device",
    "empty_cache",
    "synchronize",
    "init",
    "ipc_collect",
    "manual_seed",
    "manual_seed_all",
    "reset_peak_memory_stats",
    "reset_max_memory_allocated",
)
"""Functions of `torch.cuda` that then do nothing."""

_ANSWERS: Final = {
    "is_available": True,
    "device_count": 1,
    "current_device": 0,
    "get_device_name": "gspure cuda-free",
    "memory_allocated": 0,
    "max_memory_allocated": 0,
    "memory_reserved": 0,
    "max_memory_reserved": 0,
}
"""Functions of `torch.cuda` that then have these results."""


_PLACING: Final = {torch.Tensor.cuda, torch.Tensor.pin_memory, torch.Tensor.to}
"""Functions that are mapped whatever their named arguments are."""


def target_device() -> str:
    """Return what "cuda" means: "cuda" where it works, else the first of "xpu", "mps" and "cpu" that PyTorch has."""
    if DEVICE.type == "cuda":
        return "cuda"
    if torch.xpu.is_available():
        return "xpu"
    return "mps" if torch.backends.mps.is_available() else "cpu"


def map_cuda() -> None:
    """Let "cuda" mean `target_device` in this thread, and the functions of `torch.cuda` do what they can without it."""
    target = target_device()
    if target == "cuda":
        torch.use_deterministic_algorithms(mode=False)  # as a program finds it without gspure
        return
    keep_freed_memory()
    _Mapping(target).__enter__()
    names = {name: _constant(None) for name in _IDLE}
    names |= {name: _constant(answer) for name, answer in _ANSWERS.items()}
    names |= {"Event": _Event, "Stream": _Stream, "stream": _Stream, "device": _Stream}
    names |= {"current_stream": _Stream, "default_stream": _Stream}
    vars(torch.cuda).update(names)
    if target == "cpu":  # optimizers of PyTorch 2.14 would ask the driver of CUDA
        torch.accelerator.current_accelerator = _constant(None)
    choose = torch.set_default_device
    torch.set_default_device = lambda device: choose(_placed(device, target))
    torch.load = _loading(torch.load, target)
    torch.nn.DataParallel.__init__ = _wrap_alone
    torch.optim.Adam.__init__ = _fusing(torch.optim.Adam.__init__)
    if torch.distributed.is_available():
        torch.distributed.init_process_group = _without_nccl(torch.distributed.init_process_group)


def declare_suppression() -> None:
    """Declare the operators of torchvision to which it adds shapes, whether they exist or not."""
    for name in ("nms", "qnms"):
        torch.library.define(f"torchvision::{name}", "(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")


class _Mapping(torch.overrides.TorchFunctionMode):  # type: ignore[misc]
    """Puts another device in place of "cuda" in every call of PyTorch."""

    def __init__(self, target: str) -> None:
        super().__init__()
        self._target = target

    def __torch_function__(
        self, function: Any, types: Any, args: Sequence[Any] = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        kwargs = kwargs or {}
        if function not in _PLACING and "device" not in kwargs:
            return function(*args, **kwargs)
        if "device" in kwargs:
            kwargs = {**kwargs, "device": _placed(kwargs["device"], self._target)}
        if function is torch.Tensor.cuda:
            return args[0].to(self._target)
        if function is torch.Tensor.pin_memory:
            return args[0]
        if function is torch.Tensor.to:
            args = [args[0], *(_placed(argument, self._target) for argument in args[1:])]
        return function(*args, **kwargs)


def _placed(device: Any, target: str) -> Any:
    """Return the target in place of "cuda", "cuda:0", such a device, or an index; anything else as it is."""
    named = isinstance(device, str) and device.startswith("cuda")
    typed = isinstance(device, torch.device) and device.type == "cuda"
    return target if named or typed or type(device) is int else device


def _constant(answer: object) -> Callable[..., object]:
    return lambda *_, **__: answer


def _loading(load: Callable[..., Any], target: str) -> Callable[..., Any]:
    """Return `torch.load` that puts tensors of CUDA on the target."""

    def loaded(file: Any, map_location: Any = None, *args: Any, **kwargs: Any) -> Any:
        location = target if map_location is None else _placed(map_location, target)
        return load(file, location, *args, **kwargs)

    return loaded


def _wrap_alone(wrapper: Any, module: Any, *_: Any, **__: Any) -> None:
    """Wrap a module as `DataParallel` does without devices: it calls the module."""
    torch.nn.Module.__init__(wrapper)
    wrapper.module = module
    wrapper.device_ids = []


def _fusing(begin: Callable[..., None]) -> Callable[..., None]:
    """Return the beginning of an optimizer that moves each parameter in one pass, unless it is told how.

    PyTorch does so by default on no device; in ten passes, a step takes four to seven times as long on the CPU.
    """

    def begun(*args: Any, **kwargs: Any) -> None:
        is_told = any(kwargs.get(name) for name in ("foreach", "differentiable")) or kwargs.get("fused") is not None
        begin(*args, **kwargs if is_told else kwargs | {"fused": True})

    return begun


def _without_nccl(begin: Callable[..., Any]) -> Callable[..., Any]:
    """Return `init_process_group` that refuses NCCL."""

    def begun(backend: str | None = None, *args: Any, **kwargs: Any) -> Any:
        if "nccl" in (backend or ""):
            raise RuntimeError("gspure cuda-free: NCCL needs CUDA; the backend gloo does not")
        return begin(backend, *args, **kwargs)

    return begun


class _Event:
    """A point in time, by the host's clock."""

    def __init__(self, *_: Any, **__: Any) -> None:
        self.seconds = 0.0

    def record(self, *_: Any) -> None:
        """Take the time."""
        self.seconds = time.perf_counter()

    def elapsed_time(self, end: _Event) -> float:
        """Return the milliseconds until another event."""
        return 1e3 * (end.seconds - self.seconds)

    def synchronize(self) -> None:
        """Wait for nothing."""


class _Stream(AbstractContextManager[None]):
    """A stream, or the choice of a stream or device, of which there is only one."""

    def __init__(self, *_: Any, **__: Any) -> None:
        pass

    def __exit__(self, *_: object) -> None:
        pass

    def synchronize(self) -> None:
        """Wait for nothing."""

    def wait_stream(self, *_: Any) -> None:
        """Wait for nothing."""
