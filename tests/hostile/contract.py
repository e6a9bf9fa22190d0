"""What every reader owes to every file: a valid result, or one line that says what is wrong; and nothing else happens.

A reader is run in a process of its own, so that a crash, a hang or a runaway allocation belongs to a case.
Case `n` of a reader is the same file whenever and wherever it is written: `python -m tests.hostile replay READER n`.
"""

from __future__ import annotations

import faulthandler
import json
import mmap
import os
import resource
import shutil
import signal
import struct
import sys
import time
import traceback
import unicodedata
import warnings
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gspure.artifacts.checksums import forget
from gspure.errors import InputError
from tests.hostile.bytes_and_text import Rng, choose
from tests.hostile.mutations import SPECIAL, mutate, place, remove

SEED = 2026
CPU_SECONDS = 2.0
"""A reader takes no longer for any of these small files; most take a millisecond."""

WALL_SECONDS = 60.0
"""A process is ended that is at one case for so long: it hangs."""

MEMORY = 512 << 20
"""Bytes that a reader may allocate beyond what its process has."""

GROWTH = 192 << 20
"""Bytes by which the memory in use may grow in one case."""

LONGEST_LINE = 2000

READ, REFUSED, CHECKSUM, UNCHANGED, CRASHED = "read", "refused", "refused by checksum", "unchanged", "crashed"
ENDINGS = (READ, REFUSED, CHECKSUM, UNCHANGED, CRASHED)
"""How a case ends; a corruption may leave a file as it is, and a checksum may hide it from the parser."""

_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGES = {
    "os.mkdir": (0, 2),
    "os.rename": (1, 3),
    "os.remove": (0, 1),
    "os.rmdir": (0, 1),
    "os.symlink": (1, 2),
    "os.link": (1, 3),
    "os.truncate": (0, None),
}
"""Where an event of Python's audit has the path, and the folder that it is relative to."""


@dataclass(frozen=True)
class Reader:
    """One way into the package.

    Parameters
    ----------
    build : function
        Writes valid files into a folder.
    read : function
        Reads them from there, and asserts what must hold of what is read.
    targets : mapping
        The files to be corrupted, and their formats (`tests.hostile.mutations.FORMS`).
    available : bool
        False where a package that it needs is not installed.

    """

    name: str
    build: Callable[[Path], Any]
    read: Callable[[Path], Any]
    targets: Mapping[str, str]
    available: bool = True

    def target(self, rng: Rng) -> tuple[str, str]:
        return choose(rng, list(self.targets.items()))


_FORBIDDEN = ("os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "socket.connect", "pickle.find_class")


@dataclass(frozen=True)
class Violation:
    """A case in which a reader broke the contract: what was done to which file, and what came of it."""

    reader: str
    case: int
    target: str
    mutation: str
    kind: str
    detail: str
    place: str = ""

    @property
    def signature(self) -> tuple[str, str, str]:
        """What cases of the same defect have in common."""
        return self.reader, self.kind, self.place or self.detail[:40]


@dataclass(frozen=True)
class Case:
    """Which file was corrupted, the ending, of `ENDINGS`, and the violations."""

    target: str
    ending: str
    violations: list[Violation]


class Watch:
    """What a process does beside returning: writes outside a folder, programs, connections, warnings."""

    def __init__(self) -> None:
        self.folder: Path | None = None
        self.events: list[tuple[str, str]] = []
        sys.addaudithook(self._hook)

    def _hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self.folder is None:
            return
        path, base = None, None
        if event == "open" and isinstance(arguments[2], int) and arguments[2] & _WRITES:
            path = arguments[0]
        elif event in _CHANGES:
            path, base = (None if at is None else arguments[at] for at in _CHANGES[event])
        elif event in _FORBIDDEN:
            self.events.append(("executes", f"{event} {arguments!r}"[:200]))
        if isinstance(path, str | bytes | os.PathLike):
            root = f"/proc/self/fd/{base}" if isinstance(base, int) and base >= 0 else ""
            place = os.path.realpath(os.path.join(root, os.fsdecode(path)))  # noqa: PTH118 -- may hold a NUL
            if not f"{place}{os.sep}".startswith(f"{self.folder}{os.sep}") and (event, place) != ("open", os.devnull):
                self.events.append(("writes outside", f"{event} {place}"[:200]))

    @contextmanager
    def over(self, folder: Path) -> Iterator[list[tuple[str, str]]]:
        """Watch while a folder is the only place to write to; yield what else happens."""
        self.events = []
        with warnings.catch_warnings(record=True) as shown:
            warnings.simplefilter("always")
            self.folder = folder
            try:
                yield self.events
            finally:
                self.folder = None
        self.events += [("warns", f"{each.category.__name__}: {each.message}"[:200]) for each in shown]


def faults_of_line(line: str, folder: Path) -> Iterator[tuple[str, str]]:
    """Yield what is wrong with a refusal as a line for the user."""
    unfit = sorted({f"U+{ord(c):04X}" for c in line if unicodedata.category(c) in {"Cc", "Cs", "Zl", "Zp"}})
    if unfit:
        yield "unprintable", f"{' '.join(unfit)} in {line[:200]!r}"
    text = line.replace(str(folder), "")
    if f".{os.getpid()}" in text or ".gspure-" in text:
        yield "temporary name", text[:200]
    if len(text) > LONGEST_LINE:
        yield "long line", f"{len(text)} characters: {text[:120]}..."


def outcome(reader: Reader, folder: Path, watch: Watch) -> tuple[str, list[tuple[str, str, str]]]:
    """Let a reader read; return the ending, of `ENDINGS`, and what it did wrong as (kind, detail, place)."""
    faults: list[tuple[str, str, str]] = []
    ending = READ
    start = time.process_time()
    with watch.over(folder) as events:
        try:
            reader.read(folder)
        except InputError as error:
            ending = CHECKSUM if error.expected.startswith("CRC-32 ") else REFUSED
            faults += [(kind, detail, "") for kind, detail in faults_of_line(str(error), folder)]
        except AssertionError as error:
            faults.append(("invalid result", str(error)[:200] or "an assertion", _place(error, "tests/")))
        except BaseException as error:  # noqa: BLE001 -- whatever comes is what is looked for
            faults.append((type(error).__name__, str(error)[:200], _place(error, "gspure/")))
    faults += [(kind, detail, detail.split()[0]) for kind, detail in events]
    if (seconds := time.process_time() - start) > CPU_SECONDS:
        faults.append(("slow", f"{seconds:.1f} s", ""))
    return ending, faults


def _place(error: BaseException, within: str) -> str:
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if within in frame.filename]
    return f"{frames[-1].filename.rpartition(within)[2]}:{frames[-1].name}" if frames else ""


def generator(reader: Reader, case: int) -> np.random.Generator:
    return np.random.default_rng([SEED, zlib.crc32(reader.name.encode()), case])


def corrupted(reader: Reader, case: int, pristine: Path) -> tuple[str, str, bytes]:
    """Return the file that a case corrupts, how, and what it then holds."""
    rng = generator(reader, case)
    target, form = reader.target(rng)
    mutation, content = mutate(form, (pristine / target).read_bytes(), rng)
    return target, mutation, content


def run_case(reader: Reader, case: int, pristine: Path, folder: Path, watch: Watch) -> Case:
    """Corrupt one file of a copy of the valid ones, read them, and put everything back."""
    target, mutation, content = corrupted(reader, case, pristine)
    victim = folder / target
    place(victim, mutation, content)
    ending, faults = outcome(reader, folder, watch)
    remove(victim)
    if mutation not in SPECIAL and content == (pristine / target).read_bytes():
        ending = UNCHANGED
    if {path.name for path in folder.iterdir()} != {path.name for path in pristine.iterdir()}:
        shutil.rmtree(folder)
        shutil.copytree(pristine, folder)
    else:
        shutil.copy2(pristine / target, victim)
    return Case(target, ending, [Violation(reader.name, case, target, mutation, *fault) for fault in faults])


def prepared(reader: Reader, root: Path) -> tuple[Path, Path]:
    """Return a folder with a reader's valid files, which it accepts, and a copy to work in."""
    pristine, folder = root / "valid", root / "work"
    pristine.mkdir(parents=True)
    reader.build(pristine)
    for target in reader.targets:
        if f"{target}.json" not in reader.targets:
            forget(pristine / target)  # else its checksum refuses every change
    shutil.copytree(pristine, folder)
    reader.read(folder)
    shutil.rmtree(folder)
    shutil.copytree(pristine, folder)
    return pristine, folder


# Processes


def torment(reader: Reader, cases: range, root: Path) -> Iterator[Case]:
    """Run cases of a reader in processes of their own, each of which lasts until a case breaks it."""
    pristine, folder = prepared(reader, root)
    report, board = root / "cases", mmap.mmap(-1, 8)
    report.touch()
    begun = cases.start
    while begun < cases.stop:
        board[:8] = struct.pack("<q", begun)
        child = os.fork()
        if not child:
            _work(reader, range(begun, cases.stop), pristine, folder, report, board)
        status, hung = _awaited(child, board)
        begun = struct.unpack("<q", board[:8])[0]
        if status:
            target, mutation, _ = corrupted(reader, begun, pristine)
            kind = "hangs" if hung else f"crashes: {signal.Signals(-status).name}" if status < 0 else f"exits: {status}"
            yield Case(target, CRASHED, [Violation(reader.name, begun, target, mutation, kind, "")])
            begun += 1
        shutil.rmtree(folder)
        shutil.copytree(pristine, folder)
    for line in report.read_text(encoding="utf-8").splitlines():
        case = json.loads(line)
        yield Case(case["target"], case["ending"], [Violation(**violation) for violation in case["violations"]])


def _awaited(child: int, board: mmap.mmap) -> tuple[int, bool]:
    """Return a child's exit status, minus its signal, and whether it hung at a case and was ended."""
    at, since, hung = board[:8], time.monotonic(), False
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status), hung
        if board[:8] != at:
            at, since = board[:8], time.monotonic()
        elif time.monotonic() - since > WALL_SECONDS and not hung:
            os.kill(child, signal.SIGKILL)
            hung = True
        time.sleep(0.01)


def _work(reader: Reader, cases: range, pristine: Path, folder: Path, report: Path, board: mmap.mmap) -> None:
    """Run cases until they end or one needs too much memory; the board says which is at hand."""
    status = 70
    try:
        faulthandler.disable()
        os.chdir(folder.parent)
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        size = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        watch = Watch()
        with report.open("a", encoding="utf-8") as stream:
            for case in cases:
                board[:8] = struct.pack("<q", case)
                before = _peak()
                ended = run_case(reader, case, pristine, folder, watch)
                if (grown := _peak() - before) > GROWTH:
                    target, mutation, _ = corrupted(reader, case, pristine)
                    violation = Violation(reader.name, case, target, mutation, "memory", f"{grown >> 20} MiB")
                    ended.violations.append(violation)
                stream.write(json.dumps(asdict(ended)) + "\n")
                stream.flush()
                if grown > GROWTH:
                    board[:8] = struct.pack("<q", case + 1)
                    os._exit(0)
        board[:8] = struct.pack("<q", cases.stop)
        status = 0
    except BaseException:  # noqa: BLE001 -- the status reports it
        report.with_name("trouble").write_text(traceback.format_exc(), encoding="utf-8")
    finally:
        os._exit(status)


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10
