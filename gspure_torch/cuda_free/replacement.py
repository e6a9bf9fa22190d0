"""What is replaced in a program, and how its processes learn of it: an environment variable, read at their start."""

from __future__ import annotations

import ast
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from gspure import codec
from gspure_torch.cuda_free.dialects import Dialect

VARIABLE: Final = "GSPURE_CUDA_FREE"
STARTUP: Final = Path(__file__).parent / "startup"
MODULES: Final = Path(__file__).parent / "modules"
NAMES: Final = ("diff_gaussian_rasterization", "fused_ssim", "gsplat", "simple_knn")
"""The packages in `MODULES`."""
_KEPT: Final = "gsplat"  # where it is installed, since all but its compiled part needs no CUDA
_COMPILED: Final = "gsplat.csrc"

_DEPTH: Final = 3  # folders between a checkout and the setup.py of an extension


@dataclass(frozen=True)
class Replacement:
    """The dialect of the rasterizer, and the checkout's packages with CUDA code that have no replacement."""

    dialect: Dialect
    refused: tuple[str, ...] = ()

    @staticmethod
    def of_this_process() -> Replacement:
        """Return what ``gspure cuda-free`` has passed on."""
        replacement: Replacement = codec.read(Replacement, json.loads(os.environ[VARIABLE]), VARIABLE)
        return replacement


def extensions_of(folder: Path) -> tuple[str, ...]:
    """Return the packages that the setup.py files of a checkout compile for CUDA, without those in `NAMES`.

    The files are parsed, and nothing in them is executed.
    """
    names: set[str] = set()
    for depth in range(_DEPTH + 1):
        for path in folder.glob("/".join(["*"] * depth + ["setup.py"])):
            with suppress(OSError, SyntaxError, ValueError):
                names |= {*_extensions(ast.parse(path.read_text(encoding="utf-8")))}
    return tuple(sorted(names - {*NAMES}))


def _extensions(tree: ast.AST) -> Iterator[str]:
    """Yield the package of each call of `CUDAExtension`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("CUDAExtension"):
            named = [keyword.value for keyword in node.keywords if keyword.arg == "name"]
            for value in [*named, *node.args[:1]]:
                if isinstance(value, ast.Constant):
                    yield str(value.value).partition(".")[0]


def environment(replacement: Replacement, variables: Mapping[str, str]) -> dict[str, str]:
    """Return `variables` with those that replace modules in every Python of a program.

    ``python`` is the one that runs gspure. Threads that wait do not spin, since PyTorch and the OpenCL driver each have
    as many threads as there are cores.
    """
    paths = [str(STARTUP), *filter(None, [variables.get("PYTHONPATH")])]
    programs = [str(Path(sys.executable).parent), *filter(None, [variables.get("PATH")])]
    threads = {"OMP_NUM_THREADS": str(len(os.sched_getaffinity(0))), "OMP_WAIT_POLICY": "PASSIVE"}
    replaced = {
        VARIABLE: codec.text(replacement),
        "PYTHONPATH": os.pathsep.join(paths),
        "PATH": os.pathsep.join(programs),
    }
    return {**threads, **variables, **replaced}


def install() -> None:
    """Replace modules in this process from now on."""
    sys.meta_path.insert(0, _Finder(Replacement.of_this_process()))


class _Finder(MetaPathFinder):
    """Finds the modules in `MODULES` before any other, refuses packages, and acts after some imports."""

    def __init__(self, replacement: Replacement) -> None:
        self._replacement = replacement

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the replacement of a module, if it has one; refuse one that would need CUDA."""
        package = fullname.partition(".")[0]
        if fullname == _COMPILED:
            return PathFinder.find_spec(fullname, [str(MODULES / _KEPT)], target)
        if package in NAMES and not (package == _KEPT and PathFinder.find_spec(_KEPT)):
            return PathFinder.find_spec(fullname, [str(MODULES)] if path is None else path, target)
        if package in self._replacement.refused:
            raise ModuleNotFoundError(_refusal(package), name=package)
        if fullname in _AFTERWARDS:
            return _followed(PathFinder.find_spec(fullname, path, target), _AFTERWARDS[fullname])
        return None


def _refusal(name: str) -> str:
    return f"gspure cuda-free: {name} needs CUDA, and gspure has no replacement"


def _followed(spec: ModuleSpec | None, act: Callable[[ModuleType], None]) -> ModuleSpec | None:
    """Let an action follow the import of a module."""
    if spec and spec.loader:
        execute = spec.loader.exec_module

        def execute_and_act(module: ModuleType) -> None:
            execute(module)
            act(module)

        vars(spec.loader)["exec_module"] = execute_and_act
    return spec


def _map_cuda(_: ModuleType) -> None:
    from gspure_torch.cuda_free.mapping import map_cuda

    map_cuda()


def _refuse_compilation(module: ModuleType) -> None:
    """Refuse extensions that a program compiles while it runs."""

    def refuse(name: str, *_: Any, **__: Any) -> None:
        raise ImportError(_refusal(name))

    vars(module).update(load=refuse, load_inline=refuse)


def _declare_operators(module: ModuleType) -> None:
    """Let torchvision be imported where its compiled operators need libraries of CUDA; calls of them still fail."""
    from gspure_torch.cuda_free.mapping import declare_suppression

    if not vars(module)["_has_ops"]():
        declare_suppression()


def gsplat_rasterization() -> Callable[..., Any]:
    """Return gsplat's function, in the dialect of the program."""
    from gspure_torch.cuda_free.gsplat import rasterization

    return partial(rasterization, Replacement.of_this_process().dialect.has_radii_per_axis)


def _replace_rasterization(module: ModuleType) -> None:
    vars(module).update(rasterization=gsplat_rasterization())


_AFTERWARDS: Final = {
    "gsplat.rendering": _replace_rasterization,
    "torch": _map_cuda,
    "torch.utils.cpp_extension": _refuse_compilation,
    "torchvision.extension": _declare_operators,
}
