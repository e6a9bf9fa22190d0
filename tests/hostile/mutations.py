"""Seeded corruption of files: of bytes, of text, and of the structure of the formats that the package reads."""

from __future__ import annotations

import ast
import gzip
import io
import json
import os
import re
import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

Rng = np.random.Generator
Mutator = Callable[[bytes, Rng], bytes]

NUMBERS = (
    *(
        "nan",
        "NaN",
        "inf",
        "-Infinity",
        "-1",
        "0",
        "-0.0",
        "1e308",
        "-1e308",
        "1e400",
        "1e-320",
        "3.5e38",
        "0x10",
        "1_0",
    ),
    *("2147483648", "-2147483649", "4294967295", "18446744073709551616", "9" * 400, "9" * 5000, "1e99999", "1.5"),
    *("\u0661\u0662", "\u00b2", "1j", "+1", " ", "", "true", "null", "[]", "--1", "1e", "256"),
)
"""What may stand where a number should."""

NAMES = (
    *(
        "..",
        ".",
        "/",
        "//",
        "//x/y",
        "/etc/passwd",
        "../../outside",
        "a/../../b",
        "..\\..\\b",
        "C:\\b",
        "~",
        "~/x",
        "-rf",
    ),
    *(
        "a\0b",
        "a\nb",
        "a\r\nb",
        "\x1b[31mred",
        "\x7f",
        "\x85",
        "a\u2028b",
        "\u202egnp.exe",
        "\ufeff",
        "a" * 300,
        "x" * 5000,
    ),
    *(
        "\u00e4\u00f6\u00fc",
        "\u65e5\u672c\u8a9e",
        "\U0001f600",
        "e\u0301",
        "\ud800",
        "con",
        ".hidden",
        " ",
        "",
        "a b",
        "{x}",
        "%s",
    ),
    *("$5_and_$6", "<b>x</b>", "a;b", "`id`", "$(id)", "*", "?", "a\tb", '"', "'", "a,b", "#", "__proto__", "x.png/y"),
)
"""What may stand where a name should."""

INTEGERS = (-(2**63), -(2**31), -1, 0, 1, 127, 255, 256, 65535, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1)
FLOATS = (np.nan, np.inf, -np.inf, -1.0, 0.0, -0.0, 3e38, -3e38, 1e-45, 1e308, 1e30, 2.0**31, 89.0, -104.0)


def choose(rng: Rng, options):
    return options[int(rng.integers(len(options)))]


def span(rng: Rng, size: int, largest: int = 64) -> tuple[int, int]:
    """A random range of up to `largest` places out of `size`."""
    start = int(rng.integers(size + 1))
    return start, min(size, start + 1 + int(rng.integers(largest)))


# Bytes


def flip(content: bytes, rng: Rng) -> bytes:
    changed = bytearray(content)
    for place in rng.integers(len(content), size=rng.integers(1, 9)) if content else ():
        changed[place] ^= int(rng.integers(1, 256))
    return bytes(changed)


def truncate(content: bytes, rng: Rng) -> bytes:
    return content[: int(rng.integers(len(content) + 1))]


def splice(content: bytes, rng: Rng) -> bytes:
    """One piece moves, or is copied, over another place."""
    start, stop = span(rng, len(content))
    target = int(rng.integers(len(content) + 1))
    return content[:target] + content[start:stop] + content[target + (stop - start) * int(rng.integers(2)) :]


def zero(content: bytes, rng: Rng) -> bytes:
    start, stop = span(rng, len(content), 4096)
    return content[:start] + bytes(stop - start) + content[stop:]


def repeat(content: bytes, rng: Rng) -> bytes:
    start, stop = span(rng, len(content), 512)
    return content[:stop] + content[start:stop] * int(rng.integers(1, 50)) + content[stop:]


def drop(content: bytes, rng: Rng) -> bytes:
    start, stop = span(rng, len(content))
    return content[:start] + content[stop:]


def insert(content: bytes, rng: Rng) -> bytes:
    place = int(rng.integers(len(content) + 1))
    return content[:place] + rng.bytes(int(rng.integers(1, 64))) + content[place:]


def overwrite_integer(content: bytes, rng: Rng) -> bytes:
    layout = choose(rng, ("<B", "<H", "<I", "<Q", ">I", ">Q"))
    value = choose(rng, INTEGERS) % (1 << 8 * struct.calcsize(layout))
    return overwritten(content, struct.pack(layout, value), int(rng.integers(len(content) + 1)))


def overwrite_float(content: bytes, rng: Rng) -> bytes:
    """A float32 or float64 at a place where one may stand."""
    layout = choose(rng, ("<f4", "<f8", ">f4"))
    with np.errstate(over="ignore"):
        number = np.array(choose(rng, FLOATS)).astype(layout).tobytes()
    return overwritten(content, number, 4 * int(rng.integers(len(content) // 4 + 1)) + len(content) % 4)


def overwritten(content: bytes, piece: bytes, place: int) -> bytes:
    return content[:place] + piece + content[place + len(piece) :]


BYTES: tuple[Mutator, ...] = (
    *(flip, truncate, splice, zero, repeat, drop, insert, overwrite_integer, overwrite_float),
)


# Text

_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][A-Za-z_0-9./]*")
_GAPS = (
    b"",
    b" ",
    b"\t",
    b"\n",
    b",",
    b"\r",
    b":",
    b"- ",
    b"{",
    b"}",
    b"[",
    b"]",
    b"(",
    b")",
    b'"',
    b"'",
    b"#",
    b"\\",
    b"&a ",
    b"*a",
)


def _replaced(content: bytes, pattern: re.Pattern[bytes], replacement: str, rng: Rng) -> bytes:
    matches = list(pattern.finditer(content))
    if not matches:
        return content
    match = choose(rng, matches)
    return content[: match.start()] + encoded(replacement) + content[match.end() :]


def encoded(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")


def replace_number(content: bytes, rng: Rng) -> bytes:
    return _replaced(content, _NUMBER, choose(rng, NUMBERS), rng)


def replace_word(content: bytes, rng: Rng) -> bytes:
    return _replaced(content, _WORD, choose(rng, NAMES + NUMBERS), rng)


def insert_gap(content: bytes, rng: Rng) -> bytes:
    place = int(rng.integers(len(content) + 1))
    return content[:place] + choose(rng, _GAPS) + content[place:]


def edit_lines(content: bytes, rng: Rng) -> bytes:
    """A line is dropped, repeated or moved."""
    lines = content.splitlines(keepends=True) or [b""]
    line = lines.pop(int(rng.integers(len(lines))))
    copies = int(rng.integers(4))
    place = int(rng.integers(len(lines) + 1))
    return b"".join([*lines[:place], *[line] * copies, *lines[place:]])


def nest(content: bytes, rng: Rng) -> bytes:
    """Deep brackets in place of a number."""
    depth = choose(rng, (10, 200, 3000, 100_000))
    opening, closing = choose(
        rng, (("[", "]"), ("(", ")"), ("{", "}"), ('{"a":', "}"), ("-", ""), ("- ", ""), ("[{", ""))
    )
    return _replaced(content, _NUMBER, opening * depth + "1" + closing * depth, rng)


def recode(content: bytes, rng: Rng) -> bytes:
    text = content.decode("utf-8", "replace")
    codec = choose(rng, ("utf-16", "utf-8-sig", "utf-32", "latin-1", "cp037"))
    return text.encode(codec, "replace")


TEXT: tuple[Mutator, ...] = (
    *(
        replace_number,
        replace_number,
        replace_word,
        insert_gap,
        edit_lines,
        nest,
        recode,
        flip,
        truncate,
        splice,
        repeat,
        insert,
    ),
)


# JSON


def json_value(content: bytes, rng: Rng) -> bytes:
    """One value of the tree becomes another, is dropped, doubled, or takes the place of all."""
    try:
        tree = json.loads(content)
    except (ValueError, RecursionError):
        return flip(content, rng)
    places: list[tuple] = []
    _collect(tree, places)
    if not places:
        return content
    holder, key = choose(rng, places)
    match int(rng.integers(6)):
        case 0:
            del holder[key]
        case 1 if isinstance(holder, list):
            holder.insert(key, holder[key])
        case 1:
            holder[choose(rng, NAMES)] = holder[key]
        case 2:
            return encoded(json.dumps(holder[key]))
        case _ if isinstance(holder[key], str):
            holder[key] = choose(rng, NAMES)
        case _:
            holder[key] = choose(
                rng, (*FLOATS, *INTEGERS, 10**400, *NAMES, None, True, [], {}, [[]], "1", {"a": 1}, [0] * 1000)
            )
    return encoded(json.dumps(tree, ensure_ascii=bool(rng.integers(2))))


def _collect(tree, places: list[tuple]) -> None:
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ():
        places.append((tree, key))
        _collect(value, places)


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
    return _replaced(header, re.compile(rb"float|binary_little_endian|vertex \d+"), choose(rng, kinds).decode(), rng)


def ply_body(content: bytes, rng: Rng) -> bytes:
    header, end, body = content.partition(b"end_header\n")
    text = b"format ascii" in header
    return header + end + choose(rng, TEXT if text else (overwrite_float, overwrite_float, *BYTES))(body, rng)


# Arrays

_DTYPES = (
    *(
        "<f4",
        ">f4",
        "<f8",
        "<f2",
        "<i4",
        "<u8",
        "|b1",
        "|O",
        "|S5",
        "<U3",
        "|V16",
        "<c8",
        "<M8[s]",
        "|S0",
        "<f16",
        ",",
        "x",
    ),
    *("(2,)<f4", "<f4,<f4", "O,O", "\0", "f" * 2000),
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


# Archives


@cache
def bomb(megabytes: int = 512) -> tuple[bytes, int, int]:
    """Zeros as a raw deflate stream, their CRC-32, and how many they are."""
    deflate, block, crc = zlib.compressobj(9, zlib.DEFLATED, -15), bytes(1 << 20), 0
    one = deflate.compress(block) + deflate.flush(zlib.Z_FULL_FLUSH)  # stands for itself wherever it is put
    for _ in range(megabytes):
        crc = zlib.crc32(block, crc)
    return one * megabytes + b"\x03\x00", crc, megabytes << 20


def members(content: bytes) -> dict[str, bytes] | None:
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return {name: archive.read(name) for name in archive.namelist()}
    except (zipfile.BadZipFile, ValueError, EOFError, NotImplementedError, RuntimeError, KeyError, zlib.error, OSError):
        return None


def zipped(entries: list[tuple[str, bytes]], rng: Rng | None = None, method: int = zipfile.ZIP_STORED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a name may stand twice
        for name, data in entries:
            info = zipfile.ZipInfo("x")
            info.filename = name  # as it is: the constructor cuts names off at a NUL
            info.compress_type = method
            if rng is not None and rng.random() < 0.1:
                info.external_attr = choose(rng, (0o120777, 0o040755, 0o010644, 0o020644)) << 16
            try:
                archive.writestr(info, data)
            except (ValueError, UnicodeEncodeError):
                archive.writestr("odd", data)
    return stream.getvalue()


def zip_member(inner: Mutator) -> Mutator:
    """Corrupt one member, with the right checksum."""

    def mutate(content: bytes, rng: Rng) -> bytes:
        files = members(content)
        if not files:
            return flip(content, rng)
        victim = choose(rng, list(files))
        files[victim] = inner(files[victim], rng)
        return zipped(list(files.items()))

    return mutate


def zip_names(content: bytes, rng: Rng) -> bytes:
    """Members are renamed, dropped, doubled, compressed, or become links."""
    entries = list((members(content) or {"x": b"x"}).items())
    at = int(rng.integers(len(entries)))
    name, data = entries[at]
    folder = name.rpartition("/")[0]
    match int(rng.integers(5)):
        case 0:
            entries[at] = choose(rng, NAMES), data
        case 1:
            entries[at] = f"{folder}/{choose(rng, NAMES)}", data
        case 2:
            del entries[at]
        case 3:
            entries.append((choose(rng, (name, f"{name}/x", folder or "y", f"{folder}/../x")), data))
    method = choose(rng, (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA))
    return zipped(entries, rng, method)


def zip_directory(content: bytes, rng: Rng) -> bytes:
    """Corrupt where the archive's directory and local headers stand: sizes, methods, flags, offsets."""
    signatures = [match.start() for match in re.finditer(rb"PK\x01\x02|PK\x03\x04|PK\x05\x06", content)]
    if not signatures:
        return flip(content, rng)
    start = choose(rng, signatures)
    return content[:start] + overwrite_integer(content[start : start + 46], rng)[:46] + content[start + 46 :]


def zip_bomb(content: bytes, rng: Rng) -> bytes:
    """One member unpacks to half a gigabyte, whatever the directory says of its size."""
    names = list(members(content) or {"x": b"x"})
    victim = choose(rng, names)
    data, crc, size = bomb()
    stated = choose(rng, (size, 100))
    name = victim.encode()
    common = struct.pack("<HHHHHIIIHH", 20, 0, zipfile.ZIP_DEFLATED, 0, 33, crc, len(data), stated, len(name), 0)
    rest = zipped([(other, (members(content) or {}).get(other, b"")) for other in names if other != victim])
    stream = io.BytesIO(rest)
    with zipfile.ZipFile(stream, "a") as archive:
        offset = archive.start_dir
        archive.fp.seek(offset)
        archive.fp.write(b"PK\x03\x04" + common + name + data)
        archive.start_dir = archive.fp.tell()
        info = zipfile.ZipInfo(victim)
        info.compress_type, info.CRC, info.compress_size, info.file_size = zipfile.ZIP_DEFLATED, crc, len(data), stated
        info.header_offset = offset
        archive.filelist.append(info)
        archive._didModify = True
    return stream.getvalue()


_PICKLED = (
    *(
        b"cos\nsystem\n",
        b"(S'echo'\ntR",
        b"\x8c\x02os",
        b"\x93",
        b"Q",
        b"}",
        b"]",
        b"(",
        b"t",
        b"u",
        b"b",
        b"R",
        b"0",
        b".",
    ),
    *(
        b"J\xff\xff\xff\x7f",
        b"\x8a\xff",
        b"h\x00",
        b"q\x00",
        b"X\xff\xff\xff\xff",
        b"ccollections\nOrderedDict\n",
        b")R",
    ),
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
        return gzip.compress(choose(rng, BYTES)(gzip.decompress(content), rng))
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


def npy_any(content: bytes, rng: Rng) -> bytes:
    return choose(rng, (npy_header, npy_body, *BYTES))(content, rng)


def bytes_any(content: bytes, rng: Rng) -> bytes:
    return choose(rng, BYTES)(content, rng)


FORMS: dict[str, tuple[Mutator, ...]] = {
    "bytes": BYTES,
    "text": TEXT,
    "json": (json_value, json_value, json_value, *TEXT),
    "ply": (ply_header, ply_header, ply_body, ply_body, *BYTES),
    "npy": (npy_header, npy_header, npy_body, *BYTES),
    "npz": (*[zip_member(npy_any)] * 6, *[zip_names] * 2, *[zip_directory] * 2, *BYTES),
    "pth": (*[zip_member(pickled)] * 6, *[zip_names] * 2, *[zip_directory] * 2, *BYTES),
    "gzip": (*[gzip_content] * 6, *BYTES),
    "zip": (*[zip_names] * 6, *[zip_member(bytes_any)] * 6, *[zip_directory] * 3, *BYTES),
    "png": (*[png_chunk] * 9, *BYTES),
}
"""By format, what may happen to a file of it; what stands twice happens twice as often."""

BOMBED = frozenset({"npz", "pth", "zip"})
BOMB_SHARE = 0.002


SPECIAL: dict[str, Callable[[Path], None]] = {
    "missing": lambda path: None,
    "folder": lambda path: path.mkdir(),
    "link to itself": lambda path: path.symlink_to(path.name),
    "link to nothing": lambda path: path.symlink_to("nothing"),
    "endless device": lambda path: path.symlink_to("/dev/zero"),
    "pipe": os.mkfifo,
}
"""What a file may be instead of a regular one."""

SPECIAL_SHARE = 0.01


def place(path: Path, mutation: str, content: bytes) -> None:
    """Replace a file by its mutation, or by something special."""
    remove(path)
    SPECIAL.get(mutation, lambda path: path.write_bytes(content))(path)


def remove(path: Path) -> None:
    """Remove a file, whatever it is; a model that was read before may still be mapped."""
    if path.is_dir() and not path.is_symlink():
        path.rmdir()
    else:
        path.unlink(missing_ok=True)


def mutate(form: str, content: bytes, rng: Rng) -> tuple[str, bytes]:
    """Return the names of the mutators that were applied, or of `SPECIAL`, and the content that they return."""
    if rng.random() < SPECIAL_SHARE:
        return choose(rng, list(SPECIAL)), content
    if form in BOMBED and rng.random() < BOMB_SHARE:
        return "zip_bomb", zip_bomb(content, rng)
    applied = []
    for _ in range(1 + int(rng.random() < 0.25)):
        mutator = choose(rng, FORMS[form])
        applied.append(mutator.__qualname__.partition(".")[0])
        content = mutator(content, rng)
    return "+".join(applied), content
