"""Optional packages of attacks and schemes, checked before the first job starts."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec

from gspure.errors import InputError


def require_packages(packages: Mapping[str, str], user: str) -> None:
    """Raise `InputError` if an optional package is not installed.

    Parameters
    ----------
    packages : mapping of str to str
        By the name under which each is imported, what pip is to install for it.
    user : str
        The attack or scheme that needs them.

    """
    for package, requirement in packages.items():
        if find_spec(package) is None:
            hint = f"pip install {requirement}"
            raise InputError(user, "package", expected=package, found="no such package", hint=hint)
