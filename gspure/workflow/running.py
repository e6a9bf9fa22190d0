"""Snakemake as a child of `gspure audit`: its environment, its events, and its end."""

import fcntl
import os
import selectors
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Final

from gspure.errors import InputError
from gspure.progress import EVENTS
from gspure.workflow.console import Console
from gspure.workflow.forecast import Forecast, forecast_lines

_SNAKEMAKE: Final = (sys.executable, "-m", "snakemake")
_STATE: Final = Path(".snakemake")
_PLUGINS: Final = Path(__file__).parent / "plugins"
_GRACE: Final = 2.0  # seconds in which jobs clean up before they are killed
_ENDING: Final = 2 * _GRACE  # seconds in which a Snakemake whose parent was killed ends
_TICK: Final = 0.25  # seconds between two looks at Snakemake


def run(options: Sequence[str], console: Console | None = None) -> bool:
    """Run Snakemake, and return whether it succeeded; a console takes the place of its output.

    Snakemake and its jobs are a process group of their own. They end with this process: an interruption ends them here,
    and if this process is killed, the logger in `plugins` ends them.
    """
    logger = ["--logger", "gspure", *(["--logger-gspure-silent"] if console else [])]
    with (
        _pipe() as (path, pipe),
        subprocess.Popen(
            [*_SNAKEMAKE, *logger, *options],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL if console else subprocess.PIPE,
            stderr=subprocess.PIPE if console else None,
            env=_environment() | {EVENTS: str(path)},
            process_group=0,
        ) as process,
    ):
        try:
            _follow(process, pipe, console)
        except BaseException:
            _end(process)
            raise
    return process.returncode == 0


def forecast(options: Sequence[str]) -> list[str]:
    """Return lines on the jobs that would run; none if Snakemake fails, with its reason on standard error."""
    planned = Forecast()
    whole = Forecast()
    succeeded = run([*options, "--dry-run"], planned)
    if planned.jobs:
        succeeded = succeeded and run([*options, "--dry-run", "--forceall"], whole)
    if not succeeded:
        return []
    return [*forecast_lines(planned.jobs, sum(whole.jobs.values()))]


def _environment() -> dict[str, str]:
    """Return this environment without the user's settings of Snakemake, and with our logger on Python's path."""
    variables = {name: value for name, value in os.environ.items() if not name.startswith("SNAKEMAKE_")}
    paths = [str(_PLUGINS), os.environ.get("PYTHONPATH", "")]
    return variables | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}


@contextmanager
def _pipe() -> Iterator[tuple[Path, int]]:
    """Make a named pipe; yield its path and the descriptor to read it."""
    with TemporaryDirectory(prefix="gspure-") as folder:
        path = Path(folder) / "events"
        os.mkfifo(path)
        reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        writer = os.open(path, os.O_WRONLY)  # without a writer, a pipe is always at its end
        try:
            yield path, reader
        finally:
            os.close(reader)
            os.close(writer)


def _follow(process: subprocess.Popen[bytes], pipe: int, console: Console | None) -> None:
    """Read events, and what Snakemake prints beside them, until it has ended."""
    streams = {pipe: console.read_event if console else _ignore}
    if process.stderr and console:
        streams[process.stderr.fileno()] = console.read_output
    if process.stdout:  # through this process, which ends quietly if its own reader does
        streams[process.stdout.fileno()] = _print
    with selectors.DefaultSelector() as selector:
        for descriptor, read in streams.items():
            os.set_blocking(descriptor, False)
            selector.register(descriptor, selectors.EVENT_READ, _Lines(read))
        has_ended = False
        while not has_ended:
            has_ended = process.poll() is not None  # what is in the streams now is all there will be
            for key, _ in selector.select(0 if has_ended else _TICK):
                if not key.data.read_from(key.fd):
                    selector.unregister(key.fd)
            if console:
                console.refresh()
    if console:
        console.end(process.returncode)


class _Lines:
    """The lines of a stream: `read` is called with each as soon as it is complete."""

    def __init__(self, read: Callable[[str], None]) -> None:
        self._read = read
        self._rest = b""

    def read_from(self, descriptor: int) -> bool:
        """Read what is there, and return whether more may come."""
        data = os.read(descriptor, 2**17)  # more than a pipe holds
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self._read(line.decode(errors="replace"))
        return bool(data)


def _ignore(line: str) -> None:
    """Leave out a line."""


def _print(line: str) -> None:
    print(line, flush=True)  # noqa: T201


def _end(process: subprocess.Popen[bytes]) -> None:
    """End Snakemake and its jobs; a second interruption ends them at once."""
    try:
        with suppress(ProcessLookupError, subprocess.TimeoutExpired):
            os.killpg(process.pid, signal.SIGINT)
            process.wait(_GRACE)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def unlock(options: Sequence[str]) -> bool:
    """Remove the lock of a Snakemake that was killed, and return whether there was one.

    Wait until that one has ended, or refuse to run beside one that lives. `options` are those of the run.
    """
    if not any(_STATE.glob("locks/*.lock")):
        return False
    with (_STATE / "gspure.lock").open("a") as alive:  # which every Snakemake holds (rules/common.smk)
        deadline = time.monotonic() + _ENDING
        while not _is_free(alive):
            if time.monotonic() > deadline:
                raise InputError(_STATE, "lock", expected="no other run here", found="one that runs")
            time.sleep(0.05)
    subprocess.run([*_SNAKEMAKE, *options, "--unlock"], env=_environment(), capture_output=True, check=False)
    return True


def _is_free(file: IO[str]) -> bool:
    """Return whether no other process has locked a file."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
