"""All schemes by name: the built-in ones, and those that installed packages offer in the group ``gspure.schemes``."""

from __future__ import annotations

from pathlib import Path

from gspure.errors import InputError
from gspure.model import Gaussians, read_model
from gspure.model.signature import Signature
from gspure.plugins import offered
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
    return offered(GROUP, Scheme, BUILT_IN, _require_settings)


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


def _require_settings(scheme: Scheme, source: str) -> None:
    """Refuse a scheme that lacks a setting that all have."""
    if missing := REQUIRED - scheme.settings.keys():
        expected = f"among others {', '.join(sorted(missing))}"
        raise InputError(source, "settings", expected=expected, found=", ".join(scheme.settings) or "none")
