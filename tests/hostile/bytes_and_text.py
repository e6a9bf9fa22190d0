"""Corruption of any bytes, of text, and of JSON."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Callable

import numpy as np

Rng = np.random.Generator
Mutator = Callable[[bytes, Rng], bytes]

NUMBERS = (
    *("nan", "NaN", "inf", "-Infinity", "-1", "0", "-0.0", "1e308", "-1e308", "1e400", "1e-320", "3.5e38", "0x10"),
    *("1_0", "2147483648", "-2147483649", "4294967295", "18446744073709551616", "9" * 400, "9" * 5000, "1e99999"),
    *("1.5", "\u0661\u0662", "\u00b2", "1j", "+1", " ", "", "true", "null", "[]", "--1", "1e", "256"),
)
"""What may stand where a number should."""

NAMES = (
    *("..", ".", "/", "//", "//x/y", "/etc/passwd", "../../outside", "a/../../b", "..\\..\\b", "C:\\b", "~", "~/x"),
    *("-rf", "a\0b", "a\nb", "a\r\nb", "\x1b[31mred", "\x7f", "\x85", "a\u2028b", "\u202egnp.exe", "\ufeff"),
    *("a" * 300, "x" * 5000, "\u00e4\u00f6\u00fc", "\u65e5\u672c\u8a9e", "\U0001f600", "e\u0301", "\ud800", "con"),
    *(".hidden", " ", "", "a b", "{x}", "%s", "$5_and_$6", "<b>x</b>", "a;b", "`id`", "$(id)", "*", "?", "a\tb"),
    *('"', "'", "a,b", "#", "__proto__", "x.png/y"),
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


def bytes_any(content: bytes, rng: Rng) -> bytes:
    return choose(rng, BYTES)(content, rng)


BYTES: tuple[Mutator, ...] = (
    *(flip, truncate, splice, zero, repeat, drop, insert, overwrite_integer, overwrite_float),
)


# Text

_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][A-Za-z_0-9./]*")
_GAPS = (
    *(b"", b" ", b"\t", b"\n", b",", b"\r", b":", b"- ", b"{", b"}", b"[", b"]", b"(", b")", b'"', b"'", b"#"),
    *(b"\\", b"&a ", b"*a"),
)


def replaced(content: bytes, pattern: re.Pattern[bytes], replacement: str, rng: Rng) -> bytes:
    matches = list(pattern.finditer(content))
    if not matches:
        return content
    match = choose(rng, matches)
    return content[: match.start()] + encoded(replacement) + content[match.end() :]


def encoded(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")


def replace_number(content: bytes, rng: Rng) -> bytes:
    return replaced(content, _NUMBER, choose(rng, NUMBERS), rng)


def replace_word(content: bytes, rng: Rng) -> bytes:
    return replaced(content, _WORD, choose(rng, NAMES + NUMBERS), rng)


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
    return replaced(content, _NUMBER, opening * depth + "1" + closing * depth, rng)


def recode(content: bytes, rng: Rng) -> bytes:
    text = content.decode("utf-8", "replace")
    codec = choose(rng, ("utf-16", "utf-8-sig", "utf-32", "latin-1", "cp037"))
    return text.encode(codec, "replace")


TEXT: tuple[Mutator, ...] = (
    *(replace_number, replace_number, replace_word, insert_gap, edit_lines, nest, recode, flip, truncate, splice),
    *(repeat, insert),
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
