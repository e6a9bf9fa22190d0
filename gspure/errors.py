"""The exception type for bad input: which file, which field, what was expected, what was found."""

import json
import os
import re
import struct
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Final

_LONGEST: Final = 500  # characters of each part of a message other than the path; ours

# Words in place of Python's, by the type of an exception:
_KINDS: Final = (
    (UnicodeDecodeError, "no UTF-8 text"),
    (RecursionError, "lists in lists, too deep"),
    (zlib.error, "damaged data"),
    ((AttributeError, IndexError, TypeError, struct.error), "another structure"),
)
_NUMBER: Final = r"could not convert string (?:to float: )?('.*?')(?: to \w+)?( at row \d+, column \d+)?"
# The same, by the beginning of a message of json, numpy, zipfile or Pillow:
_WORDS: Final = {
    _NUMBER: r"\1 in place of a number\2",
    r"invalid literal for int\(\) with base \d+: (.*)": r"\1 in place of a whole number",
    r"the dtype passed requires (\d+) columns but (\d+) were found( at row \d+)": r"\2 values in place of \1\3",
    r"zip\(\) argument \d is shorter|not enough values": "too few values",
    r"zip\(\) argument \d is longer|too many values": "too many values",
    r"Exceeds the limit \(\d+ digits\)": "a number of too many digits",
    r"EOF: reading|mmap length is greater|unexpected end of data|Truncated File|image file is": "an end too early",
    r"Array can't be memory-mapped|Object arrays cannot": "Python objects",
    r"Header does not|Cannot parse header|\('EOF in multi": "a damaged header",
    r"we only support format version": "another version of the format",
    r"the magic string|This file contains pickled|File is not a zip|cannot identify": "another kind of file, or a part",
    r"No data left in file": "an empty file",
    r"Bad CRC-32|Bad magic number": "damaged data",
}


class InputError(ValueError):
    """Unusable input, reported in one line.

    Every part may quote a file. So unprintable characters, such as line breaks and escape sequences, are escaped, and
    long text is cut: no file can control the terminal or hide the message.

    `source` is the file, device or configuration with the input, `field` the property, key or entry at fault, and
    `hint` a remedy.
    """

    def __init__(self, source: str | Path, field: str, *, expected: str, found: str, hint: str | None = None) -> None:
        self.source = printable(str(source))
        self.field = _short(field)
        self.expected = _short(expected)
        self.found = _short(found)
        self.hint = _short(hint) if hint else None
        super().__init__(str(self))

    def __reduce__(self) -> tuple[object, ...]:
        """Let another process read it: its arguments have names."""
        call = partial(type(self), self.source, self.field, expected=self.expected, found=self.found, hint=self.hint)
        return call, ()

    def __str__(self) -> str:
        line = f"{self.source}: {self.field}: expected {self.expected}, found {self.found}"
        return f"{line} ({self.hint})" if self.hint else line


class MissingFileError(InputError, FileNotFoundError):
    """A missing file, as raised by `reading`."""

    def __str__(self) -> str:
        return f"{self.source}: no such file"


def refuse_path(source: str, field: str, value: object, *, expected: str, hint: str) -> None:
    """Refuse a path, or the name of a way to generate views, in place of what is read or made from it."""
    if isinstance(value, (str, os.PathLike)):
        raise InputError(source, field, expected=expected, found=repr(value), hint=hint)


def printable(text: str) -> str:
    """Return `text` in one line, with the Python escape of every unprintable character."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def error_line(error: InputError | MemoryError | OSError) -> str:
    """Return the message of an error in one line: of bad input, too little memory, or a failure of the file system."""
    if isinstance(error, MemoryError):
        return printable(f"out of memory: {error}")
    if isinstance(error, InputError) or error.filename is None:
        return printable(str(error))
    return printable(f"{error.filename}: {error.strerror}")


def _short(text: str) -> str:
    text = printable(text)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _reason(error: Exception) -> str:
    """Return what was found, in place of Python's words for content of another structure than a reader expects."""
    match error:
        case OSError(strerror=str(reason)):
            return reason
        case KeyError():
            return f"no entry {error}"
        case json.JSONDecodeError():
            return f"a syntax error on line {error.lineno}, column {error.colno}" if error.doc else "an empty file"
    text = next((words for kinds, words in _KINDS if isinstance(error, kinds)), str(error))
    matches = ((re.match(pattern, text), words) for pattern, words in _WORDS.items())
    return next((match.expand(words) for match, words in matches if match), text)


@contextmanager
def reading(path: str | Path, content: str, field: str = "file") -> Iterator[None]:
    """Turn every exception of the block, which reads `content` from the `field` of a file, into an `InputError`.

    Libraries raise almost any exception when a file is corrupt or hostile, so every exception counts as the file's
    fault; keep the block to what depends on the file. The original exception is kept as the cause. Warnings of
    libraries about tolerable corruption are discarded, since they take several lines and name places in library code.
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
        is_missing = isinstance(error, FileNotFoundError) and not os.path.lexists(path)
        line = " ".join(_reason(error).split()) or type(error).__name__
        kind = MissingFileError if is_missing else InputError
        raise kind(path, field, expected=content, found=line) from error
