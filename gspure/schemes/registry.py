"""All schemes by name: the built-in ones, and those that installed packages offer in the group ``gspure.schemes``."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from gspure.errors import InputError
from gspure.model import Gaussians, read_model
from gspure.model.signature import Signature
from gspure.schemes import gs_hider, secure_gs, splats_in_splats
from gspure.schemes.asset import Asset
from gspure.schemes.scheme import REQUIRED, Scheme

BUILT_IN = (splats_in_splats.SCHEME, gs_hider.SCHEME, secure_gs.SCHEME)
GROUP = "gspure.schemes"

_RECOGNIZED = {Signature.GS_HIDER: gs_hider.SCHEME, Signature.SCAFFOLD_GS: secure_gs.SCHEME}
"""Models that their columns give away; all others are Gaussians and no more."""


def schemes() -> dict[str, Scheme]:
    """Return every scheme by name.

    Raises
    ------
    InputError
        If a plug-in cannot be imported, is not a `Scheme`, lacks a required setting, or takes a name in use.

    """
    found = {scheme.name: scheme for scheme in BUILT_IN}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        scheme = _load(entry)
        if scheme.name in found:
            raise InputError(_source(entry), "name", expected="a name not in use", found=repr(scheme.name))
        found[scheme.name] = scheme
    return found


def find_scheme(name: str) -> Scheme:
    """Return the scheme of this name, or raise `InputError` listing those there are."""
    known = schemes()
    if name not in known:
        raise InputError("scheme", "name", expected=f"one of {', '.join(known)}", found=repr(name))
    return known[name]


def open_asset(path: Path) -> Asset:
    """Read a public model, of the scheme that its columns give away."""
    scheme = recognized(read_model(path))
    return scheme.read_asset(path) if scheme else Asset.read(path)


def recognized(units: Gaussians) -> Scheme | None:
    """Return the scheme that a model's columns give away; None for Gaussians and no more."""
    return _RECOGNIZED.get(Signature.of(units.table.dtype.names or ()))


def _load(entry: EntryPoint) -> Scheme:
    try:
        scheme = entry.load()
    except Exception as error:  # whatever a foreign module raises, say whose it is
        message = f"{type(error).__name__}: {error}"
        raise InputError(_source(entry), entry.value, expected="an importable scheme", found=message) from error
    if not isinstance(scheme, Scheme):
        raise InputError(_source(entry), entry.value, expected="a gspure.schemes.Scheme", found=type(scheme).__name__)
    if missing := REQUIRED - scheme.settings.keys():
        expected = f"among others {', '.join(sorted(missing))}"
        raise InputError(_source(entry), "settings", expected=expected, found=", ".join(scheme.settings) or "none")
    return scheme


def _source(entry: EntryPoint) -> str:
    package = entry.dist.name if entry.dist else "unknown package"
    return f"{package} (entry point {entry.name!r} of {GROUP})"
