"""The one exception type for bad input: which file, which field, what was expected, what was found."""

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

_LONGEST: Final = 500  # characters of each part of a message other than the path; ours


class InputError(ValueError):
    """Input that cannot be used, reported in one line.

    Every part may quote a file: line breaks, escape sequences and other characters that do not print are escaped, and
    long text is cut, so that no file controls the terminal or hides the message.

    `source` is the file, device or configuration that the input came from, `field` the property, key or entry at fault,
    `hint` a remedy.
    """

    def __init__(self, source: str | Path, field: str, *, expected: str, found: str, hint: str | None = None) -> None:
        self.source = printable(str(source))
        self.field = _short(field)
        self.expected = _short(expected)
        self.found = _short(found)
        self.hint = _short(hint) if hint else None
        super().__init__(str(self))

    def __str__(self) -> str:
        line = f"{self.source}: {self.field}: expected {self.expected}, found {self.found}"
        return f"{line} ({self.hint})" if self.hint else line


class MissingFileError(InputError, FileNotFoundError):
    """A file that is not there, as raised by `reading`."""

    def __str__(self) -> str:
        return f"{self.source}: no such file"


def printable(text: str) -> str:
    """Return `text` in one line, with every character that does not print replaced by its Python escape."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def refusal(error: InputError | MemoryError | OSError) -> str:
    """Return in one line why work ended: bad input, too little memory, or what the file system refused."""
    if isinstance(error, MemoryError):
        return printable(f"out of memory: {error}")
    if isinstance(error, InputError) or error.filename is None:
        return printable(str(error))
    return printable(f"{error.filename}: {error.strerror}")


def _short(text: str) -> str:
    text = printable(text)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


@contextmanager
def reading(path: str | Path, content: str, field: str = "file") -> Iterator[None]:
    """Read the `field` of a file that should hold `content` in the block: whatever goes wrong becomes an `InputError`.

    Libraries raise almost any exception when a file is corrupt or hostile, so every exception counts as the file's
    fault; keep the block to what depends on the file. The original exception is kept as the cause. Warnings about
    corruption that a library copes with are discarded, as they take several lines and name places in its code.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if Path(path).exists() and not Path(path).is_file():  # a pipe may never end
                raise ValueError("a folder, a pipe or a device")  # noqa: TRY301
            yield
    except InputError:
        raise
    except Exception as error:
        kind = MissingFileError if isinstance(error, FileNotFoundError) and not os.path.lexists(path) else InputError
        reason = (isinstance(error, OSError) and error.strerror) or str(error)
        found = " ".join(reason.split()) or type(error).__name__
        raise kind(path, field, expected=content, found=found) from error
