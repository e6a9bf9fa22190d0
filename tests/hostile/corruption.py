"""Corrupt artifacts of every kind: whatever reads one names it, and the next runs of the workflow repair it."""

from __future__ import annotations

import os
import random
import re
from collections.abc import Callable, Iterable, Iterator
from itertools import cycle
from pathlib import Path

import numpy as np

from gspure.images import RENDERED
from tests.hostile.journal import Journal, Record
from tests.hostile.kills import copied, difference, told
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
MOST = 12
"""Files that are corrupted for each rule of a project: kinds that no earlier rule had, then others, drawn at random."""

ROUNDS = 12
"""A corrupted file may hide others that are made of it; after so many runs all must be repaired."""


def run(journal: Journal, reference: Path, scratch: Path) -> Iterator[Record]:
    """Corrupt what every rule reads, then one artifact of every kind at once; one record for each case."""
    every = [*zip(readings(jobs(reference), reference), cycle(CORRUPTIONS))]
    tried: set[str] = set()
    for rule in {job.rule: None for (job, _), _ in every}:
        cases = [case for case in every if case[0][0].rule == rule]
        random.Random(rule).shuffle(cases)  # noqa: S311
        for (job, name), how in sorted(cases, key=lambda case: kind(case[0][1]) in tried)[:MOST]:
            tried.add(kind(name))
            yield journal.record(f"{rule}.{kind(name)}", read_by, job, name, how, reference, scratch)
    yield journal.record("all", repaired, reference, scratch) | {"of": len(every)}


def kind(name: str) -> str:
    """What an artifact is called, whatever its scene and variant; those that a scheme makes have its name, too."""
    path = Path(name)
    if name.startswith("stages/"):
        return "stage"
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
    names = [name for given in job.inputs for name in _files(given, folder) if name.startswith("results/")]
    if job.rule == "accumulate_weights":
        model = Path(job.outputs[0]).parts[1:3]
        names += [str(path.relative_to(folder)) for path in (folder / "stages").joinpath(*model).rglob("*.npy")]
    return list(dict.fromkeys([*names, *(f"{name}.json" for name in names if (folder / f"{name}.json").is_file())]))


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
