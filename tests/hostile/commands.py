"""Commands of jobs, each run in a fork of this process, which notes the files that it opens.

A fork has Python and its packages imported, so that thousands can run.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import shlex
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.hostile.contract import faults_of_line
from tests.hostile.project import Job

PRELOADED = (
    "gspure.cli",
    "numpy",
    "scipy.spatial",
    "scipy.special",
    "PIL.Image",
    "plyfile",
    "hdbscan",
    "pyopencl",
    "yaml",
)
"""Modules that are imported once, not in every fork."""

PATIENCE = 300.0
"""Seconds after which a command hangs."""

_WARNING = re.compile(r"^(\S+\.py:\d+: \w*Warning|warning: results may be wrong): .*$", re.MULTILINE)


@dataclass(frozen=True)
class Run:
    """How a command ended: its exit status, minus a signal; what it printed; the files that it opened."""

    status: int
    printed: str
    opened: frozenset[str]


def run(job: Job, folder: Path) -> Run:
    """Run the command of a job in a folder."""
    for name in PRELOADED:
        importlib.import_module(name)
    words = shlex.split(job.command.partition("python -m gspure ")[2].partition(" > ")[0])
    with tempfile.TemporaryFile() as printed, tempfile.TemporaryFile() as opened:
        sys.stdout.flush()
        child = os.fork()
        if not child:
            _run_in_child(words, folder, printed.fileno(), opened.fileno())
        status = _awaited(child)
        printed.seek(0)
        opened.seek(0)
        names = frozenset(json.loads(opened.read() or b"[]"))
        return Run(status, printed.read().decode(errors="replace"), names)


def breaches(ended: Run, folder: Path) -> Iterator[str]:
    """Yield what is wrong with a command that ended: it makes its result, or refuses in one line."""
    if ended.status not in {0, 2}:
        yield f"ends with status {ended.status}: {ended.printed[-300:]!r}"
    elif "Traceback" in ended.printed:
        yield f"a traceback: {ended.printed[-300:]!r}"
    elif ended.status:
        line = ended.printed.rstrip("\n").rpartition("\n")[2]
        if not line.startswith("gspure "):
            yield f"no reason: {line[:300]!r}"
        yield from (f"{kind}: {detail}" for kind, detail in faults_of_line(line, folder))
    for warning in _WARNING.finditer(ended.printed):
        yield f"warns: {warning[0][:200]}"


def _awaited(child: int) -> int:
    """Return the exit status of a child, minus its signal; one that hangs is killed, with all that it started."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.01)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return -signal.SIGKILL


def _run_in_child(words: list[str], folder: Path, printed: int, opened: int) -> None:
    status = 1
    names: set[str] = set()

    def note(event: str, arguments: tuple[object, ...]) -> None:
        if event == "open" and isinstance(arguments[0], str | os.PathLike):
            names.add(os.path.abspath(arguments[0]))  # noqa: PTH100 -- quick, and may hold a NUL

    try:
        os.setsid()
        os.chdir(folder)
        os.dup2(printed, 1)
        os.dup2(printed, 2)
        sys.stdout, sys.stderr = (os.fdopen(descriptor, "w", closefd=False) for descriptor in (1, 2))
        sys.addaudithook(note)
        from gspure import cli

        status = cli.main(words)
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 1
    except BaseException:  # noqa: BLE001 -- a breach, whatever it is
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os.write(opened, json.dumps(sorted(names), ensure_ascii=True).encode())
        os._exit(status & 0xFF)
