"""Digests by which the workflow knows what to run again: of the code behind a result, and of the user's files."""

import ast
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.util import find_spec, resolve_name
from pathlib import Path
from typing import Final

from gspure.files import digest
from gspure.opencl.program import kernel_digest

_PACKAGE: Final = Path(__file__).parents[1]


def file_states_digest(files: Iterable[str | Path]) -> str:
    """Return a digest of the names, sizes and times of the files that exist; photographs would take long to read."""
    states = ((file, Path(file).stat()) for file in files if Path(file).is_file())
    return digest(*(f"{file} {state.st_size} {state.st_mtime_ns}" for file, state in states))


def code_digest(*sources: str | Path) -> str:
    """Return a digest of the source of modules and scripts, and of all that these import, at any depth.

    Only sources of this package and of a plug-in's package count, also those imported inside functions, and with
    `gspure.opencl` the kernels. This package's ``__init__`` does not count: it only names the public functions.
    """
    scripts = [source for source in sources if isinstance(source, Path)]
    known = {source for source in sources if isinstance(source, str)}
    for script in scripts:
        known |= {name for name in _named(script.read_bytes(), []) if name.startswith("gspure.") and _file(name)}
    waiting = [*known]
    while waiting:
        new = _imports(waiting.pop()) - known
        known |= new
        waiting += new
    kernels = kernel_digest() if "gspure.opencl" in known else ""
    return digest(kernels, *(file.read_bytes() for file in [*scripts, *filter(None, map(_file, sorted(known)))]))


@cache
def _imports(module: str) -> frozenset[str]:
    if not (file := _file(module)):
        return frozenset()
    parents = module.split(".")
    names = _named(file.read_bytes(), parents if file.name == "__init__.py" else parents[:-1])
    packages = {"gspure", parents[0]}
    return frozenset(name for name in names if name != "gspure" and name.split(".")[0] in packages and _file(name))


def _named(source: bytes, parents: list[str]) -> Iterator[str]:
    """Yield the modules that a source imports, and the names imported from them, which may be modules too."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = resolve_name("." * node.level + (node.module or ""), ".".join(parents))
            yield from (module, *(f"{module}.{alias.name}" for alias in node.names))


@cache
def _file(module: str) -> Path | None:
    """Return the source of a module; None without one."""
    top, *inner = module.split(".")
    if top == "gspure":
        home = _PACKAGE
    elif (spec := find_spec(top)) is None:
        return None
    elif spec.submodule_search_locations:
        home = Path(spec.submodule_search_locations[0])
    else:
        home = Path(spec.origin or top).with_suffix("")
    path = home.joinpath(*inner)
    source = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return source if source.exists() else None
