"""Attacks and schemes of installed packages, and the optional packages that attacks and schemes need."""

from collections.abc import Callable, Iterable, Mapping
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

    `group` is also the package that defines `kind`; `require` refuses an unsuitable plug-in, given the plug-in and its
    source. Raise `InputError` if a plug-in cannot be imported, has another type, is unsuitable, or takes a name that is
    already in use.
    """
    by_name = {plugin.name: plugin for plugin in built_in}
    for entry in sorted(entry_points(group=group), key=lambda entry: entry.name):
        source = _source(entry, group)
        plugin = _load(entry, kind, source, f"{group}.{kind.__name__}")
        require(plugin, source)
        if plugin.name in by_name:
            raise InputError(source, "name", expected="a name not in use", found=repr(plugin.name))
        by_name[plugin.name] = plugin
    return by_name


def _load(entry: EntryPoint, kind: type[T], source: str, expected: str) -> T:
    try:
        plugin = entry.load()
    except Exception as error:  # a foreign module may raise anything
        message = f"{type(error).__name__}: {error}"
        importable = f"an importable {kind.__name__.lower()}"
        raise InputError(source, entry.value, expected=importable, found=message) from error
    if not isinstance(plugin, kind):
        raise InputError(source, entry.value, expected=f"a {expected}", found=type(plugin).__name__)
    return plugin


def _source(entry: EntryPoint, group: str) -> str:
    package = entry.dist.name if entry.dist else "unknown package"
    return f"{package} (entry point {entry.name!r} of {group})"


def require_packages(packages: Mapping[str, str], user: str) -> None:
    """Raise `InputError` if an optional package that `user`, an attack or scheme, needs is not installed.

    `packages` are, by the name under which each is imported, what pip is to install for it.
    """
    for package, requirement in packages.items():
        if find_spec(package) is None:
            hint = f"pip install {requirement}"
            raise InputError(user, "package", expected=package, found="no such package", hint=hint)
