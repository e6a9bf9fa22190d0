"""Command-line options of jobs."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any


def options(settings: Mapping[str, Any], *names: str) -> str:
    """Return options for some of `settings`, ``--tau-c 4.0 --tau-n 4.0``; none for a setting that is null."""
    words = []
    for name in names:
        if (value := settings[name]) is not None:
            words += [f"--{name.replace('_', '-')}", *(value if isinstance(value, list) else [value])]
    return shlex.join(map(str, words))


def setting_options(settings: Mapping[str, Any]) -> str:
    """Return the settings of an attack or a scheme as options: ``--set fraction=0.5``."""
    return shlex.join(word for name, value in settings.items() for word in ("--set", f"{name}={value}"))


def column_options(folders: Mapping[str, str]) -> str:
    """Return folders of images by title as options: ``--column gspure=FOLDER``."""
    return shlex.join(word for title, folder in folders.items() for word in ("--column", f"{title}={folder}"))
