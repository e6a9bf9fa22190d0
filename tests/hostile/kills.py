"""Jobs of every rule that are killed at their work; after a second run, all is as if nothing had happened."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from tests.hostile.journal import Journal, Record
from tests.hostile.project import Job, contents, ended, environment, one_per_rule

TIMED, PLANNED = 1, 2
"""Kills of each rule at a random time, and before a random change on disk."""

TRIES = 4
"""Times that a kill is tried which comes after the end of its job, each time earlier."""

STARTUP = 0.4
"""Share of a job's time within which it is not killed: Python starts and imports."""

HOOK = str(Path(__file__).with_name("sabotage"))


def run(journal: Journal, reference: Path, scratch: Path, rules: Collection[str]) -> Iterator[Record]:
    """Kill a job of every rule several times; one record for each rule."""
    for job in one_per_rule(reference, rules):
        yield journal.record(job.rule, killed, job, reference, scratch)


def killed(job: Job, reference: Path, scratch: Path) -> Record:
    """Kill one job, and let it run again after each kill."""
    rng = np.random.default_rng([len(job.rule), *job.rule.encode()])
    expected = contents(reference)
    folder = copied(reference, scratch)
    products, seconds, changes = measured(job, folder, expected)
    faults = [f"not reproduced: {name}" for name in difference(contents(folder), expected)]
    folder = copied(reference, scratch)
    plans: list[dict[str, Any]] = [{"after": float(t)} for t in rng.uniform(STARTUP, 1.0, TIMED) * seconds]
    plans += [{"change": int(n)} for n in rng.integers(1, changes + 1, PLANNED)] if changes else []
    hits = []
    for plan in plans:
        hits.append(hit(job, folder, products, plan))
        if not hits[-1]["hit"]:
            faults.append(f"never killed by {plan}")
        torn = [name for name, digest in contents(folder).items() if expected.get(name) != digest]
        faults += [f"half-written after {plan}: {name}" for name in torn]
        again = ended(job.command, folder)
        if again.status:
            faults.append(f"second run after {plan} ends with status {again.status}: {last_lines(job, folder)}")
        faults += [f"differs after {plan}: {name}" for name in difference(contents(folder), expected)]
        if faults:
            folder = copied(reference, scratch)
    return {"rule": job.rule, "seconds": seconds, "changes": changes, "kills": hits, "faults": faults}


def hit(job: Job, folder: Path, products: list[str], plan: dict[str, Any]) -> dict[str, Any]:
    """Kill a job without its products; if the kill comes after the end, plan it earlier."""
    for _ in range(TRIES):
        remove(folder, products)
        if kill(job, folder, plan):
            return {**plan, "hit": True}
        plan = {name: type(value)(0.75 * value) for name, value in plan.items()}
    return {**plan, "hit": False}


def measured(job: Job, folder: Path, expected: dict[str, str]) -> tuple[list[str], float, int]:
    """Run a job from nothing, and again; return its products, and the seconds and changes on disk of the second run."""
    remove(folder, [name for name in expected if is_of(job, name)])
    before = contents(folder)
    first = ended(job.command, folder)
    if first.status:
        raise RuntimeError(f"{job.rule}: {first.printed} {last_lines(job, folder)}")
    after = contents(folder)
    products = [name for name in after if before.get(name) != after[name]]
    if not products:
        raise RuntimeError(f"{job.rule}: no product to be torn")
    remove(folder, products)
    counter = folder.with_name("changes")
    counter.write_bytes(b"")
    second = ended(job.command, folder, **hooked(folder, HOSTILE_COUNT=str(counter)))
    return products, second.seconds, len(counter.read_bytes())


def is_of(job: Job, name: str) -> bool:
    """Whether a file is one of a job's outputs, lies below one, or is the record of one."""
    return any(name == output or name.startswith((f"{output}/", f"{output}.")) for output in job.outputs)


def kill(job: Job, folder: Path, plan: dict[str, Any]) -> bool:
    """Start a job and kill all of its processes; tell whether that came before its end."""
    more = hooked(folder, HOSTILE_KILL=str(plan["change"])) if "change" in plan else {}
    started = time.monotonic()
    process = subprocess.Popen(
        ["bash", "-c", job.command],
        cwd=folder,
        env=environment(**more),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    if "after" in plan:
        try:
            process.wait(max(0.0, plan["after"] - (time.monotonic() - started)))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
    return process.wait() == -signal.SIGKILL


def hooked(folder: Path, **more: str) -> dict[str, str]:
    from tests.hostile.project import ROOT

    return {"PYTHONPATH": f"{HOOK}{os.pathsep}{ROOT}", "HOSTILE_FOLDER": str(folder), **more}


def copied(reference: Path, scratch: Path) -> Path:
    folder = scratch / "project"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(reference, folder)
    return folder


def remove(folder: Path, names: list[str]) -> None:
    for name in names:
        (folder / name).unlink(missing_ok=True)


def difference(actual: dict[str, str], expected: dict[str, str]) -> list[str]:
    return sorted(name for name in actual.keys() | expected.keys() if actual.get(name) != expected.get(name))


def last_lines(job: Job, folder: Path) -> str:
    """The last lines of a job's log."""
    log = folder / job.log
    return " / ".join(log.read_text(errors="replace").splitlines()[-3:])[-400:] if log.is_file() else "no log"
