"""Corrupt artifacts of every kind: whatever reads one names it, and the next runs of the workflow repair it."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from itertools import cycle
from pathlib import Path

import numpy as np

from gspure.images import RENDERED
from tests.hostile.journal import Journal, Record
from tests.hostile.kills import copied, difference, told
from tests.hostile.project import Job, contents, ended, one_per_rule, snakemake

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
ROUNDS = 12
"""A corrupted file may hide others that are made of it; after so many runs all must be repaired."""


def run(journal: Journal, reference: Path, scratch: Path) -> Iterator[Record]:
    """Corrupt what every rule reads, then one artifact of every kind at once; one record for each case."""
    for job in one_per_rule(reference):
        for name, how in zip(inputs(job, reference), cycle(CORRUPTIONS)):
            yield journal.record(f"{job.rule}.{kind(name)}.{how}", read_by, job, name, how, reference, scratch)
    for how in (*CORRUPTIONS, DELETE):
        yield journal.record(f"all.{how}", repaired, how, reference, scratch)


def kind(name: str) -> str:
    """What an artifact is called, whatever its scheme, scene and variant."""
    return "stage" if name.startswith("stages/") else re.sub(r"\d+", "N", Path(name).name)


def inputs(job: Job, folder: Path) -> Iterator[str]:
    """Yield one file of each kind that a job reads and the workflow has made."""
    names = [name for given in job.inputs for name in _files(given, folder) if name.startswith("results/")]
    if job.rule == "accumulate_weights":
        model = Path(job.outputs[0]).parts[1:3]
        names += [str(path.relative_to(folder)) for path in (folder / "stages").joinpath(*model).rglob("*.npy")]
    yield from {kind(name): name for name in names}.values()


def _files(given: str, folder: Path) -> list[str]:
    path = folder / given
    return [str(p.relative_to(folder)) for p in path.rglob("[!.]*") if p.is_file()] if path.is_dir() else [given]


def corrupted(path: Path, how: str) -> None:
    """Corrupt a file; its times stay, as when a disk fails."""
    status = path.stat()
    path.write_bytes(CORRUPTIONS[how](path.read_bytes(), np.random.default_rng([*path.name.encode()])))
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def read_by(job: Job, name: str, how: str, reference: Path, scratch: Path) -> Record:
    """Run a job on a corrupted file: it names the file, and makes nothing of it."""
    folder = copied(reference, scratch)
    corrupted(folder / name, how)
    before = contents(folder)
    done = ended(job.command, folder)
    after = contents(folder)
    said = done.printed + told(job, folder)
    changed = [path for path in difference(after, before) if path != name and not path.endswith(".corrupt")]
    faults = ["a traceback"] if "Traceback" in said else []
    named = bool(done.status) and Path(name).name in said
    if done.status and not named:
        faults.append(f"not named: {said[-300:]!r}")
    if changed and not named:
        faults.append(f"read in silence: {changed[:3]}")
    outcome = "named" if named else "silent" if faults else "not read"
    return {"rule": job.rule, "file": kind(name), "how": how, "outcome": outcome, "said": said[-300:], "faults": faults}


def repaired(how: str, reference: Path, scratch: Path) -> Record:
    """Corrupt one artifact of every kind; all are reported, and runs of the workflow repair them to the same bytes."""
    folder = copied(reference, scratch)
    expected = contents(folder)
    victims = {kind(name): name for name in expected if how != DELETE or not is_record(folder / name)}.values()
    for name in victims:
        (folder / name).unlink() if how == DELETE else corrupted(folder / name, how)
    lines = ended("python -m gspure stages --verify", folder).printed
    reported = [name for name in victims if name in lines or f"{Path(name).parent}: images: " in lines]
    for name in victims if how != DELETE else ():
        os.utime(folder / name)
    runs, said = 0, ""
    while runs < ROUNDS:
        runs += 1
        done = snakemake(folder, "--keep-going")
        said += done.printed
        if not done.status:
            break
    left = difference(contents(folder), expected)
    return {
        "rule": "all",
        "how": how,
        "corrupted": len(victims),
        "reported": len(reported),
        "runs": runs,
        "faults": [
            *(f"not listed: {name}" for name in victims if name not in reported),
            *(f"not repaired: {name}" for name in left if not name.endswith(".corrupt")),
        ],
    }


def is_record(path: Path) -> bool:
    """Whether a file only describes others: without it, they are read unchecked."""
    return path.name == RENDERED or (path.suffix == ".json" and path.with_suffix("").is_file())
