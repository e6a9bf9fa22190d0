"""Corruption of ZIP archives: of their members, names and directory; members that unpack to half a gigabyte."""

from __future__ import annotations

import io
import re
import struct
import warnings
import zipfile
import zlib
from functools import cache

from tests.hostile.bytes_and_text import NAMES, Mutator, Rng, choose, flip, overwrite_integer


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
    except Exception:  # noqa: BLE001 -- zipfile raises almost any, such as OverflowError, if an earlier mutation hit it
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
                info = zipfile.ZipInfo("odd")
                info.compress_type, info.external_attr = method, 0o600 << 16
                archive.writestr(info, data)
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
