"""The one exception type for bad input: which file, which field, what was expected, what was found."""

import os
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Any, Final

_LONGEST: Final = 500  # characters of each part of a message other than the path; ours


class InputError(ValueError):
    """Input that cannot be used, reported in one line.

    Every part may quote a file: line breaks, escape sequences and other characters that do not print are escaped, and
    long text is cut, so that no file controls the terminal or hides the message.

    Parameters
    ----------
    source : str or Path
        File, device or configuration that the input came from.
    field : str
        The property, key or entry at fault.
    expected, found : str
        The expected value, and the actual one.
    hint : str, optional
        A remedy.

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

    def __reduce__(self) -> tuple[Any, tuple[str, str]]:
        """Support copies to other processes; by default, exceptions are rebuilt from their message alone."""
        rebuild = partial(type(self), expected=self.expected, found=self.found, hint=self.hint)
        return rebuild, (self.source, self.field)


class MissingFileError(InputError, FileNotFoundError):
    """A file that is not there."""

    def __str__(self) -> str:
        return f"{self.source}: no such file"


def printable(text: str) -> str:
    """Return `text` in one line, with every character that does not print replaced by its Python escape."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def did_you_mean(word: str, known: Iterable[str]) -> str | None:
    """Return a hint at the known word that is most similar to a misspelt one; None if none is."""
    near = get_close_matches(word, known, 1)
    return f"did you mean {near[0]}?" if near else None


def _short(text: str) -> str:
    text = printable(text)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


@contextmanager
def reading(path: str | Path, content: str, field: str = "file") -> Iterator[None]:
    """Read the `field` of a file that should hold `content` in the block: whatever goes wrong becomes an `InputError`.

    Libraries raise almost any exception when a file is corrupt or hostile, so every exception counts as the file's
    fault; keep the block to what depends on the file. The original exception is kept as the cause. Warnings about
    corruption that a library copes with are discarded, as they take several lines and name places in its code.

    A missing file becomes a `MissingFileError`, which is also a `FileNotFoundError`.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            _refuse_special(Path(path))
            yield
    except InputError:
        raise
    except Exception as error:
        is_missing = isinstance(error, FileNotFoundError) and not os.path.lexists(path)
        kind = MissingFileError if is_missing else InputError
        raise kind(path, field, expected=content, found=_reason(error)) from error


def _refuse_special(path: Path) -> None:
    """Refuse what is there but no regular file: a pipe may never end, and a device holds any number of bytes."""
    if path.is_dir():
        raise ValueError("a folder")
    if path.exists() and not path.is_file():
        raise ValueError("a pipe or a device")


def _reason(error: Exception) -> str:
    match error:
        case FileNotFoundError():
            return "no such file"
        case MemoryError():
            return "more than fits into memory"
        case RecursionError():
            return "too deep nesting"
        case OSError(strerror=str(reason)):
            return reason
        case ValueError() | SyntaxError() if "set_int_max_str_digits" in str(error):
            return "a whole number of too many digits"
    return " ".join(str(error).split()) or type(error).__name__
