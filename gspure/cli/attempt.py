"""``gspure attempt``: one job of a workflow, whose failure must not stop the others."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from pathlib import Path
from typing import Final

HELP = "run another command such that its failure is noted beside its files, and stops nothing else"
EXAMPLES = """\
  gspure attempt --after model.ply --makes gof.ply kept.npy --log attack.log \\
      -- attack gof --model model.ply --out gof.ply --kept kept.npy
"""

INTERRUPTIONS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals by which somebody wants it to end: no failures."""

SHELL_SIGNAL: Final = 128
"""What shells add to a signal's number to make an exit status."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument(
        "--after", type=Path, nargs="*", default=[], metavar="PATH", help="without these there is nothing to be tried"
    )
    parser.add_argument("--makes", type=Path, nargs="+", required=True, metavar="PATH", help="what the command makes")
    parser.add_argument("--log", type=Path, required=True, metavar="FILE", help="takes all that the command prints")
    parser.add_argument("command", nargs="+", metavar="COMMAND", help="a command of gspure and its arguments, after --")


def run(args: argparse.Namespace) -> int:
    """Run the command in a process of its own: one that is killed for want of memory has failed like others."""
    from gspure.failures import mark_failed, mark_made, note_of

    args.log.parent.mkdir(parents=True, exist_ok=True)
    if reason := next(filter(None, (note_of(path).reason for path in args.after)), ""):
        args.log.write_text(f"not tried: {reason}\n", encoding="utf-8")
        mark_failed(args.makes, reason, own=False)
        return 0
    status = _status_of(args.command, args.log)
    if status == 0:
        mark_made(args.makes)
        return 0
    if -status in INTERRUPTIONS or status - SHELL_SIGNAL in INTERRUPTIONS:
        return SHELL_SIGNAL + abs(status) % SHELL_SIGNAL
    reason = _reason(args.command[0], status, args.log)
    mark_failed(args.makes, reason, own=True)
    print(f"{reason} (all of it: {args.log})", file=sys.stderr)
    return 0


def _status_of(command: list[str], log: Path) -> int:
    """Return the exit status of a command, or minus the signal that ended it."""
    from gspure.cli import main

    if child := os.fork():
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    with log.open("wb") as stream:
        os.dup2(stream.fileno(), 1)
        os.dup2(stream.fileno(), 2)
    raise SystemExit(main(command))


def _reason(name: str, status: int, log: Path) -> str:
    if status < 0:
        hint = ", perhaps for want of memory" if -status == signal.SIGKILL else ""
        return f"gspure {name}: ended by {signal.Signals(-status).name}{hint}"
    lines = log.read_text(encoding="utf-8", errors="replace").split("\n")
    said = next((line.strip() for line in reversed(lines) if line.strip()), f"exit status {status}")
    return said if said.startswith("gspure ") else f"gspure {name}: {said}"
