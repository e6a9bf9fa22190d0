"""The one exception type for bad input: which file, which field, what was expected, what was found."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class InputError(Exception):
    """Input that cannot be used, told in one line.

    Parameters
    ----------
    source : str or Path
        File, device or configuration that the input came from.
    field : str
        The property, key or entry at fault.
    expected, found : str
        What would have been right, and what was there instead.
    hint : str, optional
        What to do about it.

    """

    def __init__(self, source: str | Path, field: str, *, expected: str, found: str, hint: str | None = None) -> None:
        self.source = str(source)
        self.field = field
        self.expected = expected
        self.found = found
        self.hint = hint
        super().__init__(str(self))

    def __str__(self) -> str:
        line = f"{self.source}: {self.field}: expected {self.expected}, found {self.found}"
        return f"{line} ({self.hint})" if self.hint else line


@contextmanager
def reading(path: str | Path, content: str, *malformed: type[Exception]) -> Iterator[None]:
    """Read a file in the block: what goes wrong there becomes an `InputError`.

    Parameters
    ----------
    path : str or Path
        The file.
    content : str
        What it should hold.
    malformed : exception types
        What the block raises if the file holds something else.

    """
    try:
        yield
    except FileNotFoundError:
        raise InputError(path, "file", expected=content, found="no such file") from None
    except OSError as error:
        raise InputError(path, "file", expected=content, found=error.strerror or str(error)) from None
    except malformed as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(path, "file", expected=content, found=reason) from None
