"""Command-line options of jobs, and of Snakemake."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

DEFAULT_PROFILE: Final = "profiles/default"


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


def profile_options(workflow: Path) -> list[str]:
    """Return the settings of the default profile as options: Snakemake prints a line about a profile that it reads."""
    import yaml

    words = ["--workflow-profile", "none"]
    for name, value in yaml.safe_load((workflow / DEFAULT_PROFILE / "config.yaml").read_text()).items():
        values = value if isinstance(value, list) else [] if value is True else [value]
        words += [f"--{name}", *map(str, values)]
    return words
