"""What installed packages add: attacks, schemes and detectors; and the optional packages that these need."""

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Any, Final, Literal, Protocol, TypeVar

from gspure.errors import InputError

GROUP: Final = "gspure"  # of entry points, each a `Plugin`

Part = Literal["attacks", "schemes"]


class Named(Protocol):
    """An attack or a scheme."""

    @property
    def name(self) -> str:
        """Unique within its kind."""


T = TypeVar("T", bound=Named)


@dataclass(frozen=True)
class Plugin:
    """What a package adds to gspure: an entry point of the group ``gspure`` names one.

    Parameters
    ----------
    attacks : sequence of `gspure.attacks.Attack`
        Attacks on models and on renders.
    schemes : sequence of `gspure.schemes.scheme.Scheme`
        Watermarking schemes.
    detectors : mapping of str to str
        Commands that read a mark, by the name that configurations use.

    """

    attacks: Sequence[Any] = ()
    schemes: Sequence[Any] = ()
    detectors: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not all(isinstance(part, Sequence) for part in (self.attacks, self.schemes)):
            raise TypeError("attacks and schemes are lists")
        if not isinstance(self.detectors, Mapping):
            raise TypeError("detectors are a mapping of names to commands")
        if not all(isinstance(command, str) for command in self.detectors.values()):
            raise TypeError("the command of a detector is a string")


def registered(part: Part, kind: type[T], built_in: Iterable[T], require: Callable[[T, str], None]) -> dict[str, T]:
    """Return the built-in attacks or schemes, and those of plug-ins, by name.

    ``require(object, source)`` refuses an unsuitable one. Raise `InputError` if a plug-in cannot be imported, holds
    anything of another kind or anything unsuitable, or has the name of another one.
    """
    by_name = {known.name: known for known in built_in}
    for entry in installed():
        source = source_of(entry)
        for added in getattr(loaded(entry), part):
            if not isinstance(added, kind):
                raise InputError(source, part, expected=f"objects of {kind.__name__}", found=type(added).__name__)
            require(added, source)
            if added.name in by_name:
                raise InputError(source, "name", expected="a name not in use", found=repr(added.name))
            by_name[added.name] = added
    return by_name


def detectors() -> dict[str, str]:
    """Return the commands of the detectors of plug-ins, by name."""
    return {name: command for entry in installed() for name, command in loaded(entry).detectors.items()}


def added_by(entry: EntryPoint, part: Part) -> Sequence[Any]:
    """Return the attacks or schemes of a plug-in; none if it cannot be imported."""
    try:
        added: Sequence[Any] = getattr(loaded(entry), part)
    except InputError:
        return ()
    return added


def loaded(entry: EntryPoint) -> Plugin:
    """Return the plug-in of an entry point, or raise `InputError` if it cannot be imported or is none."""
    expected = "an importable gspure.Plugin"
    try:
        plugin = entry.load()
    except Exception as error:  # a foreign module may raise anything
        reason = f"{type(error).__name__}: {error}"
        raise InputError(source_of(entry), entry.value, expected=expected, found=reason) from error
    if not isinstance(plugin, Plugin):
        raise InputError(source_of(entry), entry.value, expected=expected, found=type(plugin).__name__)
    return plugin


def source_of(entry: EntryPoint) -> str:
    """Return how errors name a plug-in."""
    return f"{entry.dist.name if entry.dist else 'unknown package'} (entry point {entry.name!r} of {GROUP})"


def installed() -> list[EntryPoint]:
    """Return the entry points of plug-ins, by name; nothing is imported."""
    return _entries(tuple(sys.path))


def package_of(entry: EntryPoint) -> str:
    """Return name and version of the package of an entry point."""
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else "unknown package"


@cache
def _entries(path: tuple[str, ...]) -> list[EntryPoint]:  # noqa: ARG001 (it determines the packages)
    return sorted(entry_points(group=GROUP), key=lambda entry: entry.name)


def require_packages(packages: Mapping[str, str], user: str) -> None:
    """Raise `InputError` if an optional package that `user`, an attack or scheme, needs is not installed.

    `packages` maps the name for import of each package to its requirement for pip.
    """
    for package, requirement in packages.items():
        if find_spec(package) is None:
            hint = f"pip install '{requirement}'"
            raise InputError(user, "package", expected=package, found="no such package", hint=hint)
