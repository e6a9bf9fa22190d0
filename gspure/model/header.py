"""PLY headers, read more leniently than the standard asks, and their comments: free text of any encoding."""

import io
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from plyfile import PlyData, PlyElement

from gspure.errors import InputError, reading
from gspure.progress import warn

_LIMIT: Final = 1 << 20  # largest header in bytes; the search for its end stops there
_FEW: Final = 16  # bytes per row that a header is more likely to lack than to name too few rows; ours
_HEADER: Final = re.compile(rb"ply[ \t]*(\r\n|\n|\r)(.*?\1)??end_header[ \t]*\1", re.DOTALL)
_COMMENT: Final = re.compile(rb"\s*(?:comment|obj_info)(?:[ \t](.*))?", re.DOTALL)


class Header(NamedTuple):
    """A header, its size in bytes, and its comments."""

    content: PlyData
    size: int
    comments: tuple[str, ...]


def read_header(path: Path, content: str) -> Header:
    """Return the header of a PLY that should hold `content`; its lines end as on Unix, Windows or an old Mac."""
    with reading(path, content), path.open("rb") as stream:
        if not (header := _HEADER.match(stream.read(_LIMIT))):
            raise ValueError("no PLY, or no end of its header")
        lines = (header[2] or b"").split(header[1])[:-1]
        comments = tuple(decoded(comment[1] or b"") for line in lines if (comment := _COMMENT.fullmatch(line)))
        lines = [b"ply", *(line for line in lines if not _COMMENT.fullmatch(line)), b"end_header", b""]
        # plyfile cannot read only the header publicly, and `PlyData.read` allocates as many rows as it claims.
        return Header(PlyData._parse_header(io.BytesIO(b"\n".join(lines))), header.end(), comments)  # noqa: SLF001


def require_size(path: Path, header: Header, count: int, row: int, size: int) -> None:
    """Refuse a file whose elements have not the `size` in bytes that the header says; warn of bytes after them.

    Its `count` rows have `row` bytes. If the further bytes are as many for each, the header lacks properties.
    """
    more = path.stat().st_size - header.size - size
    each, rest = divmod(more, max(count, 1))
    if more < 0 or (not rest and (more % row or 0 < each <= _FEW) and (each < 4 or each % 4 == 0)):
        hint = "cut short: copy or download it again" if more < 0 else f"rows of {row + each} bytes?"
        most = header.size + size
        raise InputError(path, "file", expected=f"{most} bytes", found=f"{most + more} bytes", hint=hint)
    if more:
        text = f"{more // row} rows" if more % row == 0 else f"{more} bytes"
        warn(f"{path}: {text} after the last of {count} rows that the header names are not read")


def header_of(table: NDArray[Any], comments: Iterable[str] = ()) -> bytes:
    """Return the header of a little-endian PLY of one element, ``vertex``."""
    header = PlyData([PlyElement.describe(np.empty(0, table.dtype), "vertex")], byte_order="<").header.encode()
    return with_comments(header.replace(b"vertex 0\n", b"vertex %d\n" % len(table)) + b"\n", comments)


def with_comments(ply: bytes, comments: Iterable[str]) -> bytes:
    """Return a PLY with comments after its format."""
    magic, encoding, rest = ply.split(b"\n", 2)
    return b"\n".join([magic, encoding, *(b"comment " + line for line in encoded(comments)), rest])


def decoded(comment: bytes) -> str:
    """Return a comment as text: UTF-8, with other bytes as what `encoded` turns into them again."""
    return comment.decode("utf-8", "surrogateescape")


def encoded(comments: Iterable[str]) -> list[bytes]:
    """Return the bytes of comments, line by line."""
    return [line for comment in comments for line in comment.encode("utf-8", "surrogateescape").split(b"\n")]
