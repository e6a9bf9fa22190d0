"""Corrupt artifacts of every kind: whatever reads one names it, and the next runs of the workflow repair it.

Forged artifacts, with checksums of their own, are read or refused in one line.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import suppress
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np

from gspure.artifacts.checksums import file_checksum, record_file, with_checksum
from gspure.images import RENDERED
from tests.hostile import commands
from tests.hostile.journal import Journal, Record
from tests.hostile.kills import copied, difference
from tests.hostile.mutations import SPECIAL, mutate, place, remove
from tests.hostile.project import Job, contents, ended, jobs, snakemake

Corruption = Callable[[bytes, np.random.Generator], bytes]


def flip(content: bytes, rng: np.random.Generator) -> bytes:
    place = int(rng.integers(len(content)))
    return content[:place] + bytes([content[place] ^ int(rng.integers(1, 256))]) + content[place + 1 :]


def truncate(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: int(rng.integers(len(content)))]


def zero(content: bytes, rng: np.random.Generator) -> bytes:
    """Some bytes that are not zero become so."""
    places = np.flatnonzero(np.frombuffer(content, np.uint8))
    start = int(rng.choice(places))
    return content[:start] + bytes(min(60, len(content) - start)) + content[start + 60 :]


CORRUPTIONS: dict[str, Corruption] = {"flip": flip, "truncate": truncate, "zero": zero}
DELETE = "delete"
FORGERIES = 3
"""Files with renewed checksums for each pair of a rule and a kind of artifact."""

FORM_OF = {".json": "json", ".npy": "npy", ".npz": "npz", ".ply": "ply", ".png": "png", ".pth": "pth"}
FORM_OF |= dict.fromkeys((".csv", ".tsv", ".svg", ""), "text")
"""Formats of `tests.hostile.mutations` by suffix."""

ROUNDS = 12
"""A corrupted file may hide others that are made of it; after so many runs all must be repaired."""


def run(journal: Journal, reference: Path, scratch: Path, rules: Collection[str]) -> Iterator[Record]:
    """Corrupt what every rule reads, then one artifact of every kind at once; one record for each case."""
    folder = copied(reference, scratch)
    for (job, name), how in zip(readings(jobs(reference), reference), cycle(CORRUPTIONS)):
        if job.rule in rules:
            yield journal.record(f"{job.rule}.{kind(name)}", read_by, job, name, how, reference, folder)
    yield journal.record("all", repaired, reference, scratch)


def kind(name: str) -> str:
    """What an artifact is called, whatever its scene and variant; those that a scheme makes have its name, too."""
    path = Path(name)
    if name.startswith("stages/"):
        return "stage.json" if path.suffix == ".json" else "stage"
    scheme = f"{path.parts[1]}/" if {"public", "key"} & {*path.parts} else ""
    return scheme + re.sub(r"\d+", "N", path.name)


def readings(every: Iterable[Job], folder: Path) -> Iterator[tuple[Job, str]]:
    """Yield a job of each rule for each kind of artifact that it reads; a record of each kind is corrupted once."""
    tried: set[tuple[str, str]] = set()
    for job in sorted(every, key=lambda job: (job.rule, -len(job.command))):
        for name in inputs(job, folder):
            case = ("" if is_record(folder / name) else job.rule, kind(name))
            if case not in tried:
                tried.add(case)
                yield job, name


def inputs(job: Job, folder: Path) -> list[str]:
    """Return the files that a job reads and the workflow has made, with their records."""
    names = [name for source in job.inputs for name in _files(source, folder) if name.startswith("results/")]
    if job.rule == "accumulate_weights":
        model = Path(job.outputs[0]).parts[1:3]
        names += [str(path.relative_to(folder)) for path in (folder / "stages").joinpath(*model).rglob("*.npy")]
    return list(dict.fromkeys([*names, *(f"{name}.json" for name in names if (folder / f"{name}.json").is_file())]))


def _files(name: str, folder: Path) -> list[str]:
    path = folder / name
    return [str(p.relative_to(folder)) for p in path.rglob("[!.]*") if p.is_file()] if path.is_dir() else [name]


def corrupted(path: Path, how: str) -> None:
    """Corrupt a file; its times stay, as when a disk fails."""
    status = path.stat()
    path.write_bytes(CORRUPTIONS[how](path.read_bytes(), np.random.default_rng([*path.name.encode()])))
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def read_by(job: Job, name: str, how: str, reference: Path, folder: Path) -> Record:
    """Run a job on a corrupted file, which it names, and on forged ones, of which it makes a result or a refusal."""
    corrupted(folder / name, how)
    before = contents(folder)
    corrupt = commands.run(job, folder)
    changed = [path for path in difference(contents(folder), before) if path != name]
    is_opened = str(folder / name) in corrupt.opened
    faults = [*commands.breaches(corrupt, folder)]
    if corrupt.status and Path(name).name not in corrupt.printed:
        faults.append(f"not named: {corrupt.printed[-300:]!r}")
    if corrupt.status and changed:
        faults.append(f"refused, but changed: {changed[:3]}")
    if is_opened and not corrupt.status:
        faults.append("read in silence")
    restore(name, folder, reference)
    forged = {"read": 0, "refused": 0}
    for number in range(FORGERIES if corrupt.status else 0):  # a file of another size is refused without being opened
        mutation = forge(folder / name, np.random.default_rng([number, *f"{job.rule} {kind(name)}".encode()]))
        ended = commands.run(job, folder)
        forged["refused" if ended.status else "read"] += 1
        faults += [f"forged by {mutation}, number {number}: {fault}" for fault in commands.breaches(ended, folder)]
        restore(name, folder, reference)
    outcome = "named" if corrupt.status else "not opened"
    return {"rule": job.rule, "file": kind(name), "how": how, "outcome": outcome, "forged": forged, "faults": faults}


def forge(path: Path, rng: np.random.Generator) -> str:
    """Mutate a file, and renew its checksums as its author can, so that its parser is reached; return the mutations."""
    mutation, content = mutate(FORM_OF.get(path.suffix, "bytes"), path.read_bytes(), rng)
    place(path, mutation, content)
    if mutation in SPECIAL:
        return mutation
    renew(path, {})
    size, checksum = len(path.read_bytes()), file_checksum(path)
    renew(record_file(path), {"bytes": size, "crc32": checksum})
    if path.suffix == ".png":
        renew(path.with_name(RENDERED), {"bytes": {path.stem: size}, "crc32": {path.stem: checksum}})
    return mutation


def renew(record: Path, changes: dict[str, Any]) -> None:
    """Renew the checksum of a record after changes of its entries; other files stay."""
    with suppress(OSError, ValueError, RecursionError):
        entries = json.loads(record.read_bytes())
        if isinstance(entries, dict) and "record" in entries:
            for name, change in changes.items():
                entries[name] = entries[name] | change if isinstance(change, dict) else change
            record.write_text(json.dumps(with_checksum(entries)))


def restore(name: str, folder: Path, reference: Path) -> None:
    """Make a copy of a project equal to it again, after a file of this name and its records were changed."""
    records = (f"{name}.json", str(Path(name).with_name(RENDERED)))
    for path in {*difference(contents(folder), contents(reference)), name, *records}:
        remove(folder / path)
        if (reference / path).is_file():
            shutil.copy2(reference / path, folder / path)


def repaired(reference: Path, scratch: Path) -> Record:
    """Corrupt one artifact of every kind; all are reported, and runs of the workflow repair them to the same bytes."""
    folder = copied(reference, scratch)
    expected = contents(folder)
    files = {kind(name): name for name in expected if not is_record(folder / name)}.values()
    records = {kind(name): name for name in reversed(expected) if is_record(folder / name)}.values()
    for name, how in (*zip(files, cycle((*CORRUPTIONS, DELETE))), *zip(records, cycle(CORRUPTIONS))):
        if how == DELETE:
            (folder / name).unlink()
        else:
            corrupted(folder / name, how)
            os.utime(folder / name)
    victims = [*files, *records]
    lines = ended("python -m gspure stages --verify", folder).printed
    reported = [name for name in victims if name in lines or f"{Path(name).parent}: images: " in lines]
    runs = 0
    while runs < ROUNDS:
        runs += 1
        if not snakemake(folder, "--keep-going").status:
            break
    left = difference(contents(folder), expected)
    return {
        "rule": "all",
        "case": reference.name,
        "corrupted": len(victims),
        "reported": len(reported),
        "runs": runs,
        "faults": [
            *(f"not listed: {name}" for name in victims if name not in reported),
            *(f"not repaired: {name}" for name in left),
        ],
    }


def is_record(path: Path) -> bool:
    """Whether a file only describes others: without it, they are read unchecked."""
    return path.name == RENDERED or (path.suffix == ".json" and path.with_suffix("").is_file())
