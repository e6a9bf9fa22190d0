"""Jobs of every rule on a full disk and under a file-size limit; and jobs on the device with too little memory.

A job that lacks room leaves nothing half-written, and makes the same bytes once there is room. Without room on disk, it
ends with one line that says so; without memory, libraries may crash or hang.
"""

from __future__ import annotations

import os
import resource
import shutil
import signal
import subprocess
from collections.abc import Callable, Collection, Iterator
from functools import cache, partial
from pathlib import Path

from tests.hostile.journal import Journal, Record
from tests.hostile.kills import copied, difference, is_of, last_lines, remove
from tests.hostile.project import Ended, Job, contents, ended, one_per_rule

HUNGRY = ("embed_message", "measure_contributions")
"""Rules that are run with less and less memory."""

PATIENCE = 120.0
"""Seconds after which a job without room hangs."""

SHARES = (0.3, 0.5, 0.7, 0.8, 0.9, 0.97)
"""Of the address space that a job takes when there is enough."""


def run(journal: Journal, reference: Path, scratch: Path, rules: Collection[str]) -> Iterator[Record]:
    """Run a job of every rule without room on disk, and some without memory; one record for each case."""
    cases: list[tuple[str, Job, Callable[[str, Job, Path, Path], Record]]] = []
    for job in one_per_rule(reference, rules):
        cases += [("file size", job, too_large), *([("full disk", job, too_full)] if os.geteuid() == 0 else [])]
        if job.rule in HUNGRY:
            cases += [(f"memory {share}", job, too_little) for share in SHARES]
    for kind, job, case in cases:
        yield journal.record(f"{job.rule}.{kind}", case, kind, job, reference, scratch)


def too_large(kind: str, job: Job, reference: Path, scratch: Path) -> Record:
    """No file may be larger than half of the largest that the job makes."""
    folder, sizes = prepared(job, reference, scratch)
    limit = max(sizes) // 2
    return judged(kind, job, folder, reference, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))


def too_full(kind: str, job: Job, reference: Path, scratch: Path) -> Record:
    """The disk has room for half of what the job makes."""
    template, sizes = prepared(job, reference, scratch)
    used = sum(path.stat().st_size + 4096 for path in template.rglob("*"))
    folder = scratch / "disk"
    folder.mkdir(exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={used + sum(sizes) // 2}", "tmpfs", folder], check=True)
    try:
        shutil.copytree(template, folder / "project")
        filler = folder / "filler"
        room = os.statvfs(folder).f_bavail * os.statvfs(folder).f_frsize
        filler.write_bytes(bytes(max(0, room - sum(sizes) // 2)))
        return judged(kind, job, folder / "project", reference, None, lambda: grown(folder, filler))
    finally:
        subprocess.run(["umount", folder], check=True)


def grown(disk: Path, filler: Path) -> None:
    """Make room again."""
    filler.unlink()
    subprocess.run(["mount", "-o", "remount,size=2g", disk], check=True)


def too_little(kind: str, job: Job, reference: Path, scratch: Path) -> Record:
    """The job's address space is limited to a share of what it takes."""
    limit = int(float(kind.split()[1]) * address_space(job, reference, scratch))
    folder, _ = prepared(job, reference, scratch)
    return judged(kind, job, folder, reference, lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)))


@cache
def address_space(job: Job, reference: Path, scratch: Path) -> int:
    """Return the smallest limit, within 8 MiB, under which the job ends well."""
    folder, _ = prepared(job, reference, scratch)
    low, high = 0, 4 << 30
    while high - low > 8 << 20:
        middle = (low + high) // 2
        limits = partial(resource.setrlimit, resource.RLIMIT_AS, (middle, middle))
        done = ended(job.command, folder, limits, PATIENCE)
        low, high = (low, middle) if _complete(job, folder) and not done.status else (middle, high)
    return high


def _complete(job: Job, folder: Path) -> bool:
    complete = all((folder / output).exists() for output in job.outputs)
    remove(folder, [name for name in contents(folder) if is_of(job, name)])
    return complete


def prepared(job: Job, reference: Path, scratch: Path) -> tuple[Path, list[int]]:
    """Return a copy of the project without what the job makes, and the sizes of what it makes."""
    folder = copied(reference, scratch)
    products = [name for name in contents(folder) if is_of(job, name)]
    sizes = [(folder / name).stat().st_size for name in products]
    remove(folder, products)
    return folder, sizes


def judged(
    kind: str,
    job: Job,
    folder: Path,
    reference: Path,
    limits: Callable[[], None] | None,
    then: Callable[[], None] | None = None,
) -> Record:
    """Run a job under limits, and again without them; tell what is wrong with either."""
    expected = contents(reference)
    (folder / job.log).unlink(missing_ok=True)
    done = ended(job.command, folder, limits, PATIENCE)
    faults = [f"half-written: {name}" for name, digest in contents(folder).items() if expected.get(name) != digest]
    printed = done.printed + ((folder / job.log).read_text(errors="replace") if (folder / job.log).is_file() else "")
    outcome = ending(done, printed, whole=not difference(contents(folder), expected))
    if not kind.startswith("memory") and outcome != "refused":  # a limit under which the job is done is none
        faults.append(f"{outcome}: {printed[-300:]!r}")
    if outcome != "done" and not done.status:
        faults.append("ends with status 0")
    if then:
        then()
    again = ended(job.command, folder)
    if again.status:
        faults.append(f"second run ends with status {again.status}: {last_lines(job, folder)}")
    faults += [f"differs: {name}" for name in difference(contents(folder), expected)]
    return {
        "rule": job.rule,
        "kind": kind,
        "outcome": outcome,
        "status": done.status,
        "printed": printed[-300:],
        "faults": faults,
    }


def ending(done: Ended, printed: str, *, whole: bool) -> str:
    """Name the way in which a job ended; what it printed may be lost for want of room."""
    if whole:
        return "done"
    if done.hangs:
        return "hangs"
    return "crashed" if "Traceback" in printed or done.status not in {1, 2, -signal.SIGXFSZ} else "refused"
