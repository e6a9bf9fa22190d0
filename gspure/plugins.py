"""Attacks and schemes of installed packages, and the optional packages that attacks and schemes need."""

import sys
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Protocol, TypeVar

from gspure.errors import InputError


class Named(Protocol):
    """An attack or a scheme."""

    @property
    def name(self) -> str:
        """Unique within its kind."""


T = TypeVar("T", bound=Named)


def registered(group: str, kind: type[T], built_in: Iterable[T], require: Callable[[T, str], None]) -> dict[str, T]:
    """Return the built-in objects and those of the entry points of `group`, by name.

    ``require(plugin, source)`` refuses an unsuitable plug-in. Raise `InputError` if a plug-in cannot be imported, is
    not of this kind, is unsuitable, or has the name of another one.
    """
    by_name = {plugin.name: plugin for plugin in built_in}
    for entry in installed(group):
        source = f"{entry.dist.name if entry.dist else 'unknown package'} (entry point {entry.name!r} of {group})"
        expected = f"an importable {group}.{kind.__name__}"
        try:
            plugin = entry.load()
        except Exception as error:  # a foreign module may raise anything
            reason = f"{type(error).__name__}: {error}"
            raise InputError(source, entry.value, expected=expected, found=reason) from error
        if not isinstance(plugin, kind):
            raise InputError(source, entry.value, expected=expected, found=type(plugin).__name__)
        require(plugin, source)
        if plugin.name in by_name:
            raise InputError(source, "name", expected="a name not in use", found=repr(plugin.name))
        by_name[plugin.name] = plugin
    return by_name


def installed(group: str) -> list[EntryPoint]:
    """Return the entry points of a group, by name; nothing is imported."""
    return _entries(group, tuple(sys.path))


def package_of(entry: EntryPoint) -> str:
    """Return name and version of the package of an entry point."""
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else "unknown package"


@cache
def _entries(group: str, path: tuple[str, ...]) -> list[EntryPoint]:  # noqa: ARG001 (it determines the packages)
    return sorted(entry_points(group=group), key=lambda entry: entry.name)


def require_packages(packages: Mapping[str, str], user: str) -> None:
    """Raise `InputError` if an optional package that `user`, an attack or scheme, needs is not installed.

    `packages` maps the name for import of each package to its requirement for pip.
    """
    for package, requirement in packages.items():
        if find_spec(package) is None:
            hint = f"pip install '{requirement}'"
            raise InputError(user, "package", expected=package, found="no such package", hint=hint)
