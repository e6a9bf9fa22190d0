"""PLY headers, read more leniently than the standard asks, and their comments, free text of any encoding."""

import io
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from plyfile import PlyData, PlyElement

from gspure.errors import InputError, reading
from gspure.files import read_all
from gspure.progress import warn

_LIMIT: Final = 1 << 20  # largest header in bytes; the search for its end stops there
_MAGIC: Final = re.compile(rb"(?:\xef\xbb\xbf)?\s*ply[ \t]*(\r\n|\n|\r)")
_COMMENT: Final = re.compile(rb"\s*(?:comment|obj_info)(?:[ \t](.*))?", re.DOTALL)


class Header(NamedTuple):
    """A parsed header, its size in bytes, its comments, and all bytes of its file."""

    content: PlyData
    size: int
    comments: tuple[str, ...]
    file: bytes


def read_header(path: Path, content: str) -> Header:
    """Return the header of a PLY that should hold `content`; warn of superfluous blanks and empty lines."""
    with reading(path, content), path.open("rb") as stream:
        head = stream.read(_LIMIT)
        magic = _MAGIC.match(head)
        if not magic:
            raise ValueError("no PLY")
        newline = magic[1]
        is_old_mac = newline == b"\r"
        end = re.compile(rb"[\r\n][ \t]*end_header[ \t]*" + (b"\r" if is_old_mac else b"\r?\n")).search(head)
        if not end:
            raise ValueError("no end of the header")
        lines = head[magic.end() : end.start()].split(b"\r" if is_old_mac else b"\n")
        if newline == b"\r\n":
            lines = [line.removesuffix(b"\r") for line in lines]
        comments = tuple(decoded(match[1] or b"") for match in map(_COMMENT.fullmatch, lines) if match)
        lines = [line.removesuffix(b"\r") for line in lines if not _COMMENT.fullmatch(line)]
        plain = [b" ".join(line.split()) for line in lines if line.strip()]
        # plyfile cannot read only the header publicly, and `PlyData.read` allocates as many rows as it claims.
        parsed = PlyData._parse_header(io.BytesIO(b"\n".join([b"ply", *plain, b"end_header", b""])))  # noqa: SLF001
        file = read_all(stream)
    if plain != lines:
        warn(f"{path}: blanks or empty lines in the header are skipped")
    return Header(parsed, end.end(), comments, file)


def require_size(path: Path, header: Header, size: int) -> None:
    """Refuse a file with fewer bytes than its header and `size` bytes of elements; warn of bytes after these."""
    stored = len(header.file)
    expected = header.size + size
    if stored < expected:
        hint = "cut short: copy or download it again"
        raise InputError(path, "file", expected=f"{expected} bytes", found=f"{stored} bytes", hint=hint)
    if stored > expected:
        warn(f"{path}: {stored - expected} bytes after the last row that the header names are not read")


def header_of(table: NDArray[Any], comments: Iterable[str] = ()) -> bytes:
    """Return the header of a little-endian PLY of one element, ``vertex``."""
    header = PlyData([PlyElement.describe(np.empty(0, table.dtype), "vertex")], byte_order="<").header.encode()
    return with_comments(header.replace(b"vertex 0\n", b"vertex %d\n" % len(table)) + b"\n", comments)


def with_comments(ply: bytes, comments: Iterable[str]) -> bytes:
    """Return a PLY with comments after its format."""
    magic, encoding, rest = ply.split(b"\n", 2)
    return b"\n".join([magic, encoding, *(b"comment " + line for line in encoded(comments)), rest])


def decoded(comment: bytes) -> str:
    """Return a comment as text, read as UTF-8; `encoded` restores bytes of any other encoding."""
    return comment.decode("utf-8", "surrogateescape")


def encoded(comments: Iterable[str]) -> list[bytes]:
    """Return the bytes of comments, line by line."""
    return [line for comment in comments for line in comment.encode("utf-8", "surrogateescape").split(b"\n")]
