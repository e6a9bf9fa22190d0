"""What installed packages offer beside the built-in attacks and schemes, found by their entry points."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib.metadata import EntryPoint, entry_points
from typing import Protocol, TypeVar

from gspure.errors import InputError


class Named(Protocol):
    """Anything that is known by its name."""

    @property
    def name(self) -> str:
        """Unique within its kind."""


T = TypeVar("T", bound=Named)


def offered(group: str, kind: type[T], built_in: Iterable[T], require: Callable[[T, str], None]) -> dict[str, T]:
    """Return the built-in ones and those of the entry points of `group`, by name.

    Parameters
    ----------
    group : str
        Of entry points; also the package in which `kind` is to be found.
    kind : type
        What an entry point has to be.
    built_in : iterable of `kind`
    require : callable
        Refuses one that does not fit, naming the source that it is given.

    Raises
    ------
    InputError
        If a plug-in cannot be imported, is not of the kind, does not fit, or takes a name that is already in use.

    """
    found = {one.name: one for one in built_in}
    for entry in sorted(entry_points(group=group), key=lambda entry: entry.name):
        source = _source(entry, group)
        one = _load(entry, kind, source, f"{group}.{kind.__name__}")
        require(one, source)
        if one.name in found:
            raise InputError(source, "name", expected="a name not in use", found=repr(one.name))
        found[one.name] = one
    return found


def _load(entry: EntryPoint, kind: type[T], source: str, expected: str) -> T:
    try:
        one = entry.load()
    except Exception as error:  # whatever a foreign module raises, say whose it is
        message = f"{type(error).__name__}: {error}"
        importable = f"an importable {kind.__name__.lower()}"
        raise InputError(source, entry.value, expected=importable, found=message) from error
    if not isinstance(one, kind):
        raise InputError(source, entry.value, expected=f"a {expected}", found=type(one).__name__)
    return one


def _source(entry: EntryPoint, group: str) -> str:
    package = entry.dist.name if entry.dist else "unknown package"
    return f"{package} (entry point {entry.name!r} of {group})"
