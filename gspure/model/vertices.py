"""The element ``vertex`` of a PLY, with one row per Gaussian or point; its header is checked before it is read."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from plyfile import PlyData, PlyElement, PlyListProperty

from gspure.artifacts import verify
from gspure.errors import InputError, reading

_HEADER_LIMIT: Final = 1 << 20  # largest header in bytes; the search for its end stops there


@dataclass(frozen=True)
class Vertices:
    """The header of a PLY whose first element is ``vertex``; rows are not allocated before they are read.

    `offset` is the size of the header in bytes.
    """

    path: Path
    header: PlyData
    offset: int

    @staticmethod
    def of(path: Path, content: str) -> Vertices:
        """Read the header of a file that should hold `content`; raise `InputError` as `read_header` and `below` do."""
        return Vertices.below(path, *read_header(path, content))

    @staticmethod
    def below(path: Path, header: PlyData, offset: int) -> Vertices:
        """Return the vertices of a header.

        Raise `InputError` if another element comes first, or a property is a list or has a name that does not print or
        holds a colon.
        """
        names = [element.name for element in header.elements]
        if names[:1] != ["vertex"]:
            raise InputError(path, "element vertex", expected="to come first", found=", ".join(names) or "no element")
        if header["vertex"].count < 0:
            raise InputError(path, "element vertex", expected="0 rows or more", found=f"{header['vertex'].count} rows")
        for stored in header["vertex"].properties:
            if isinstance(stored, PlyListProperty):
                raise InputError(path, stored.name, expected="one value per row", found="a list property")
            if not stored.name.isprintable() or ":" in stored.name:  # numpy writes no columns with colons
                raise InputError(path, "property", expected="a printable name without colons", found=repr(stored.name))
        return Vertices(path, header, offset)

    @property
    def _element(self) -> PlyElement:
        return self.header["vertex"]

    @property
    def count(self) -> int:
        """Rows that the header claims."""
        return int(self._element.count)

    @property
    def dtypes(self) -> dict[str, np.dtype[np.generic]]:
        """The type of each property, in the file's order."""
        return {stored.name: np.dtype(stored.dtype()) for stored in self._element.properties}

    @property
    def comments(self) -> tuple[str, ...]:
        """All comment lines."""
        return (*self.header.comments, *self.header.obj_info, *self._element.comments)

    def rows(self) -> NDArray[np.void]:
        """Return the rows, little-endian; those of a little-endian binary file are mapped and read-only.

        Raise `InputError` if there are fewer rows than the header claims, something follows the last element,
        or a row of an ASCII file is malformed.
        """
        if self.header.text:
            return self._parsed()
        stored = self._element.dtype(self.header.byte_order)
        self._require_room(self.offset, stored.itemsize)
        self._require_end()
        if not self.count:
            return np.empty(0, self._element.dtype("<"))
        rows = np.memmap(self.path, stored, "r", self.offset, self.count).view(np.ndarray)
        return rows.astype(self._element.dtype("<"), copy=False)

    def _parsed(self) -> NDArray[np.void]:
        self._require_room(self.offset - 1, 2 * len(self._element.properties))  # a digit and a separator, but the last
        with (
            reading(self.path, "one number per property, in its range", "element vertex"),
            self.path.open("rb") as stream,
        ):
            stream.seek(self.offset)
            text = io.TextIOWrapper(stream, encoding="ascii")
            # numpy's parser is several times faster than plyfile's.
            most = self.count + (len(self.header.elements) == 1)
            rows = np.loadtxt(text, self._element.dtype("<"), comments=None, max_rows=most, ndmin=1)
        if len(rows) != self.count:
            raise InputError(self.path, "element vertex", expected=f"{self.count} rows", found=f"{len(rows)} rows")
        return rows

    def _require_room(self, offset: int, row_bytes: int) -> None:
        """Refuse a file that is too short for the rows that its header claims."""
        room = (self.path.stat().st_size - offset) // row_bytes
        if room < self.count:
            raise InputError(self.path, "element vertex", expected=f"{self.count} rows", found=f"room for {room}")

    def _require_end(self) -> None:
        """Refuse a binary file that goes on after its last element; lists make an element's size unknown."""
        stored = [(element.count, element.dtype(self.header.byte_order)) for element in self.header.elements]
        if any(dtype.hasobject for _, dtype in stored):
            return
        expected = self.offset + sum(count * dtype.itemsize for count, dtype in stored)
        if (size := self.path.stat().st_size) != expected:
            raise InputError(self.path, "file", expected=f"{expected} bytes", found=f"{size} bytes")


def read_header(path: Path, content: str) -> tuple[PlyData, int]:
    """Return the header of a PLY that should hold `content`, and its size in bytes.

    Raise `InputError` if the file differs from its checksum or is no PLY.
    """
    verify(path)
    with reading(path, content), path.open("rb") as stream:
        head = io.BytesIO(stream.read(_HEADER_LIMIT))
        for number, line in enumerate(head.getvalue().partition(b"end_header")[0].splitlines(), start=1):
            if not line.isascii() and line.startswith((b"comment", b"obj_info")):
                found = line.decode(errors="replace")
                raise InputError(path, "file", expected=f"a comment in ASCII in line {number}", found=found)
        # plyfile cannot read only the header publicly, and `PlyData.read` allocates as many rows as it claims.
        return PlyData._parse_header(head), head.tell()  # noqa: SLF001
