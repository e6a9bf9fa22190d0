"""Seeded corruption of files of each format, and what may stand where a regular file should."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from tests.hostile.archives import zip_bomb, zip_directory, zip_member, zip_names
from tests.hostile.bytes_and_text import BYTES, TEXT, Mutator, Rng, bytes_any, choose, json_value
from tests.hostile.containers import (
    gzip_content,
    npy_any,
    npy_body,
    npy_header,
    pickled,
    ply_body,
    ply_header,
    png_chunk,
)

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
