"""Corruption inside models, arrays, pickles, compressed files and images, so that what encloses it stays intact."""

from __future__ import annotations

import ast
import gzip
import re
import struct
import zlib

from tests.hostile.bytes_and_text import (
    BYTES,
    TEXT,
    Rng,
    choose,
    encoded,
    flip,
    overwrite_float,
    overwrite_integer,
    replaced,
)

# PLY


def ply_header(content: bytes, rng: Rng) -> bytes:
    header, end, body = content.partition(b"end_header\n")
    return choose(rng, (*TEXT, _ply_kind))(header, rng) + end + body


def _ply_kind(header: bytes, rng: Rng) -> bytes:
    kinds = (
        b"double",
        b"uchar",
        b"list uchar int",
        b"float32",
        b"int",
        b"ascii",
        b"binary_big_endian",
        b"quux",
        b"vertex 1e3",
    )
    return replaced(header, re.compile(rb"float|binary_little_endian|vertex \d+"), choose(rng, kinds).decode(), rng)


def ply_body(content: bytes, rng: Rng) -> bytes:
    header, end, body = content.partition(b"end_header\n")
    text = b"format ascii" in header
    return header + end + choose(rng, TEXT if text else (overwrite_float, overwrite_float, *BYTES))(body, rng)


# Arrays

_DTYPES = (
    *("<f4", ">f4", "<f8", "<f2", "<i4", "<u8", "|b1", "|O", "|S5", "<U3", "|V16", "<c8", "<M8[s]", "|S0", "<f16"),
    *(",", "x", "(2,)<f4", "<f4,<f4", "O,O", "\0", "f" * 2000),
)
_SHAPES = ((), (0,), (-1,), (2**62,), (2**31, 2**31), (1,) * 40, (5, 0), (10**30,), (1.5,), ("3",), None, (True,), [5])


def npy_header(content: bytes, rng: Rng) -> bytes:
    """Another header of the right length field, or the header as text corrupted."""
    if content[:6] != b"\x93NUMPY" or len(content) < 12:
        return flip(content, rng)
    size = struct.unpack("<H", content[8:10])[0]
    header, body = content[10 : 10 + size], content[10 + size :]
    try:
        fields = ast.literal_eval(header.decode("latin-1").strip())
    except (ValueError, TypeError, SyntaxError, RecursionError, MemoryError):
        fields = {}
    if not isinstance(fields, dict):
        fields = {}
    match int(rng.integers(6)):
        case 0:
            fields["descr"] = choose(
                rng, (*_DTYPES, [("a", "<f4")], [("a", "|O")], [("a", "<f4", (2**40,))], [], 3, None)
            )
        case 1:
            fields["shape"] = choose(rng, _SHAPES)
        case 2:
            fields[choose(rng, ("fortran_order", "extra", "descr"))] = choose(rng, (True, 1, None, "x"))
        case 3:
            fields.pop(choose(rng, ("descr", "shape", "fortran_order")), None)
        case _:
            header = choose(rng, TEXT)(header, rng)
            return npy(header, body, content[6:8])
    version = choose(rng, (b"\1\0", b"\1\0", b"\1\0", b"\2\0", b"\3\0", b"\4\0", b"\0\0"))
    return npy(encoded(repr(fields) + "\n"), body, version)


def npy(header: bytes, body: bytes, version: bytes = b"\1\0") -> bytes:
    length = struct.pack("<H" if version == b"\1\0" else "<I", len(header) & 0xFFFF)
    return b"\x93NUMPY" + version + length + header + body


def npy_body(content: bytes, rng: Rng) -> bytes:
    start = 10 + int.from_bytes(content[8:10], "little")
    return content[:start] + choose(rng, (overwrite_float, overwrite_integer, *BYTES))(content[start:], rng)


def npy_any(content: bytes, rng: Rng) -> bytes:
    return choose(rng, (npy_header, npy_body, *BYTES))(content, rng)


# Pickles and gzip

_PICKLED = (
    *(b"cos\nsystem\n", b"(S'echo'\ntR", b"\x8c\x02os", b"\x93", b"Q", b"}", b"]", b"(", b"t", b"u", b"b", b"R"),
    *(b"0", b".", b"J\xff\xff\xff\x7f", b"\x8a\xff", b"h\x00", b"q\x00", b"X\xff\xff\xff\xff"),
    *(b"ccollections\nOrderedDict\n", b")R"),
)


def pickled(content: bytes, rng: Rng) -> bytes:
    """Instructions inserted into a pickle, or bytes of it corrupted."""
    if rng.random() < 0.5:
        return choose(rng, BYTES)(content, rng)
    place = int(rng.integers(len(content) + 1))
    return content[:place] + choose(rng, _PICKLED) + content[place:]


def gzip_content(content: bytes, rng: Rng) -> bytes:
    """Corrupt what is compressed, with the right checksum."""
    try:
        return gzip.compress(choose(rng, BYTES)(gzip.decompress(content), rng), mtime=0)
    except (OSError, EOFError, zlib.error):
        return flip(content, rng)


# Images

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def png_chunk(content: bytes, rng: Rng) -> bytes:
    """Corrupt one chunk, or the pixels that are compressed in it, with the right checksums."""
    chunks, place = [], len(_PNG_SIGNATURE)
    while place + 12 <= len(content):
        size = int.from_bytes(content[place : place + 4], "big")
        chunks.append((content[place + 4 : place + 8], content[place + 8 : place + 8 + size]))
        place += 12 + size
    if not chunks:
        return flip(content, rng)
    at = int(rng.integers(len(chunks)))
    kind, data = chunks[at]
    if kind == b"IDAT" and rng.random() < 0.5:
        try:
            data = zlib.compress(choose(rng, BYTES)(zlib.decompress(data), rng))
        except zlib.error:
            data = flip(data, rng)
    else:
        data = choose(rng, BYTES)(data, rng)
    chunks[at] = kind, data
    if rng.random() < 0.1:
        chunks.insert(int(rng.integers(len(chunks) + 1)), chunks.pop(at))
    return _PNG_SIGNATURE + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )
