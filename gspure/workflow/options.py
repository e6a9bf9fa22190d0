"""Command-line options of jobs."""

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


def repeated(option: str, values: Mapping[str, Any]) -> str:
    """Return named values as a repeated option: ``--set fraction=0.5 --set seed=1``."""
    return shlex.join(word for name, value in values.items() for word in (option, f"{name}={value}"))
