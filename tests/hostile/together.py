"""Two runs in one folder at the same time, and projects that were moved."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Collection, Iterator
from pathlib import Path

from tests.hostile.journal import Journal, Record
from tests.hostile.kills import copied, difference, is_of, remove
from tests.hostile.project import contents, environment, one_per_rule, snakemake

TWICE = ("measure_contributions", "attack_model", "draw_model", "embed_message")
"""Rules whose job is started twice at the same moment."""


def run(journal: Journal, reference: Path, scratch: Path, rules: Collection[str]) -> Iterator[Record]:
    """Yield one record for each case."""
    for job in one_per_rule(reference, rules):
        if job.rule in TWICE:
            yield journal.record(f"{job.rule}.twice", twice, job, reference, scratch)
    yield journal.record("workflow.twice", workflow_twice, reference, scratch)
    yield journal.record("workflow.moved", moved, reference, scratch)


def twice(job, reference: Path, scratch: Path) -> Record:
    """Both end well, with the same files as a single one."""
    folder, expected = copied(reference, scratch), contents(reference)
    remove(folder, [name for name in expected if is_of(job, name)])
    both = [subprocess.Popen(["bash", "-c", job.command], cwd=folder, env=environment()) for _ in range(2)]
    statuses = [process.wait() for process in both]
    faults = [f"ends with status {status}" for status in statuses if status]
    return {
        "case": f"{job.rule}, twice",
        "faults": faults + [f"differs: {n}" for n in difference(contents(folder), expected)],
    }


def workflow_twice(reference: Path, scratch: Path) -> Record:
    """Of two Snakemakes in one folder, one refuses; the other ends as if it were alone."""
    folder, expected = copied(reference, scratch), contents(reference)
    weights = [name for name in expected if name.endswith("weights.npy")]
    remove(folder, [*weights, *(f"{name}.json" for name in weights)])
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(Path(__file__).parents[2] / "Snakefile")]
    command += ["--configfile", "config.yaml", "--cores", "1", *weights]
    both = [
        subprocess.Popen(command, cwd=folder, env=environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for _ in range(2)
    ]
    statuses = sorted(process.wait() for process in both)
    faults = [] if statuses[0] == 0 < statuses[1] else [f"both end with status {statuses}"]
    again = snakemake(folder)
    faults += [f"a third run ends with status {again.status}"] if again.status else []
    return {
        "case": "workflow, twice",
        "faults": faults + [f"differs: {n}" for n in difference(contents(folder), expected)],
    }


def moved(reference: Path, scratch: Path) -> Record:
    """Nothing runs again in a project that was moved and renamed."""
    copied(reference, scratch).rename(scratch / "ein anderer Name $x")
    folder, expected = scratch / "ein anderer Name $x", contents(reference)
    done = snakemake(folder)
    faults = [] if "Nothing to be done" in done.printed else [f"ran again: {done.printed[-300:]!r}"]
    return {
        "case": "project, moved and renamed",
        "faults": faults + [f"differs: {n}" for n in difference(contents(folder), expected)],
    }
