"""Digests of the package's own code, so that a workflow knows which results an edit makes stale."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

from gspure.artifacts import digest

_PACKAGE = Path(__file__).parent


def code_digest(*modules: str) -> str:
    """Return a digest of the source of `modules` and of all modules of this package that they import, at any depth.

    Imports inside functions count too. The package's own ``__init__`` does not: it only names the public functions.
    Modules of other packages are passed over.
    """
    waiting = [module for module in modules if module.startswith("gspure.")]
    reached = set(waiting)
    while waiting:
        found = _imports(waiting.pop()) - reached
        reached |= found
        waiting += found
    return digest(*(_file(name).read_bytes() for name in sorted(reached)))


@cache
def _imports(module: str) -> frozenset[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(_file(module).read_bytes())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return frozenset(name for name in names if name.startswith("gspure.") and _file(name).exists())


def _file(module: str) -> Path:
    path = _PACKAGE.joinpath(*module.split(".")[1:])
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
