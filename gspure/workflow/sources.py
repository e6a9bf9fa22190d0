"""Digests of the code behind a result, by which the workflow knows the results that an edit makes stale."""

import ast
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from gspure.artifacts import digest

_PACKAGE = Path(__file__).parents[1]


def code_digest(*modules: str) -> str:
    """Return a digest of the source of `modules` and of all that these import, at any depth.

    Only Python sources of this package and of the plug-in's package count, also those imported inside functions. This
    package's ``__init__`` does not count: it only names the public functions.
    """
    waiting = [module for module in modules if _file(module)]
    known = set(waiting)
    while waiting:
        new = _imports(waiting.pop()) - known
        known |= new
        waiting += new
    return digest(*(file.read_bytes() for name in sorted(known) if (file := _file(name))))


@cache
def _imports(module: str) -> frozenset[str]:
    file = _file(module)
    names = _named(ast.parse(file.read_bytes()), _parents(module, file)) if file else ()
    packages = {"gspure", _top(module)}
    return frozenset(name for name in names if name != "gspure" and _top(name) in packages and _file(name))


def _named(tree: ast.AST, parents: list[str]) -> Iterator[str]:
    """Yield the modules that a module imports, and the names imported from them, which may be modules too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = parents[: len(parents) + 1 - node.level] if node.level else []
            source = ".".join([*above, *([node.module] if node.module else [])])
            yield from (source, *(f"{source}.{alias.name}" for alias in node.names))


def _parents(module: str, file: Path) -> list[str]:
    """Return the package in which a module's relative imports begin."""
    names = module.split(".")
    return names if file.name == "__init__.py" else names[:-1]


def _file(module: str) -> Path | None:
    """Return the source of a module; None without one."""
    top, *inner = module.split(".")
    if (home := _home(top)) is None:
        return None
    path = home.joinpath(*inner)
    source = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return source if source.exists() else None


def _home(top: str) -> Path | None:
    """Return the folder of a package, or the file of a module without its suffix; None if there is no such module."""
    if top == "gspure":
        return _PACKAGE
    spec = find_spec(top)
    if spec and spec.submodule_search_locations:
        return Path(spec.submodule_search_locations[0])
    return Path(spec.origin).with_suffix("") if spec and spec.origin else None


def _top(module: str) -> str:
    return module.partition(".")[0]
