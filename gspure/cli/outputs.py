"""Files and folders that commands write: named by options of their own type, and never an input."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path, PosixPath

from gspure.errors import InputError


class Output(PosixPath):
    """The type of options that name a file or folder to write."""


def require_distinct(args: argparse.Namespace) -> None:
    """Refuse outputs that would overwrite an input, a file in an input folder, or each other.

    A file in an input folder may be replaced if its record says that it is a result.
    """
    from gspure.artifacts.checksums import record_of

    paths = [*_paths(vars(args).values())]
    outputs = [path for path in paths if isinstance(path, Output)]
    inputs = {path.resolve() for path in paths if not isinstance(path, Output)}
    taken = set(inputs)
    for path in outputs:
        file = path.resolve()
        is_read = file.is_file() and not inputs.isdisjoint(file.parents) and record_of(path) is None
        if file in taken or is_read:
            raise InputError(path, "output", expected="a separate file", found="an input or another output")
        taken.add(file)


def _paths(values: Iterable[object]) -> Iterator[Path]:
    for value in values:
        if isinstance(value, Path):
            yield value
        elif isinstance(value, list | tuple):
            yield from _paths(value)
        elif isinstance(value, dict):
            yield from _paths(value.values())
