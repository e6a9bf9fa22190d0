"""The command line: one subcommand per stage, each in a module of its own.

A command module holds ``HELP`` (one line), ``EXAMPLES`` (shown below the options), ``add_arguments(parser)`` and
``run(args)``. It imports heavy packages inside ``run`` only, so that ``gspure --help`` stays quick.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence

from gspure import __version__
from gspure.errors import InputError

COMMANDS = (
    "purify",
    "info",
    "render",
    "metrics",
    "doctor",
    "cameras",
    "plant",
    "contributions",
    "weights",
    "features",
    "tree",
    "cluster",
    "prune",
    "attack",
    "message",
    "table",
    "figures",
    "report",
    "stages",
)


def build_parser() -> argparse.ArgumentParser:
    """Return the parser with every subcommand."""
    parser = argparse.ArgumentParser(
        prog="gspure",
        description="Measure how robust a 3D Gaussian Splatting watermark is against GSPure and other attacks.",
        epilog="`gspure COMMAND --help` shows the options and examples of one command; `gspure doctor` checks the set-up.",
    )
    parser.add_argument("--version", action="version", version=f"gspure {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        module = importlib.import_module(f"gspure.cli.{name}")
        command = commands.add_parser(
            name,
            help=module.HELP,
            description=module.HELP,
            epilog="examples:\n" + module.EXAMPLES,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(command)
        command.set_defaults(run=module.run)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; bad input gives one line on standard error and exit status 2."""
    args = build_parser().parse_args(argv)
    try:
        return int(args.run(args) or 0)
    except InputError as error:
        print(f"gspure {args.command}: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        # The reader of our output (`| head`) has gone; leave quietly, and keep Python from flushing into it again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        print(f"gspure {args.command}: interrupted", file=sys.stderr)
        return 130
