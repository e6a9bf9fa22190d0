"""The command line: one module per subcommand.

A command module holds ``HELP`` (one line), ``EXAMPLES`` (shown below the options), ``add_arguments(parser)`` and
``run(args)``; `gspure.cli.parser` has the kinds of arguments. It imports heavy packages inside ``run`` only, so that
``gspure --help`` stays quick.
"""

import argparse
import importlib
import os
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import NoReturn

from gspure import __version__, progress
from gspure.cli.parser import Arguments, Parser, require_distinct, suggestion
from gspure.cost import LOG, cost_of, spent
from gspure.errors import InputError, printable

USER_COMMANDS = (
    "audit",
    "purify",
    "info",
    "cameras",
    "render",
    "metrics",
    "pair",
    "embed",
    "extract",
    "detect",
    "attack",
    "train",
    "download",
    "failures",
    "stages",
    "paper-check",
    "doctor",
    "completion",
)
JOBS = (
    "contributions",
    "weights",
    "opacities",
    "hidden",
    "surface",
    "features",
    "tree",
    "cluster",
    "prune",
    "decoys",
    "retrieve",
    "table",
    "contest",
    "figures",
    "report",
)
COMMANDS = USER_COMMANDS + JOBS

DESCRIPTION = "Measure how robust a 3D Gaussian Splatting watermark is against GSPure and other attacks."


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; bad input gives one line on standard error and exit status 2, an interruption 130."""
    argv = sys.argv[1:] if argv is None else argv
    if not argv or argv[0] not in COMMANDS:
        _overview(argv)
    try:
        args = parser_of(argv[0]).parse_args(argv[1:])
        progress.quiet = getattr(args, "quiet", False)
        require_distinct(args)
        return _costed(args)
    except InputError as error:
        return _refuse(argv[0], str(error))
    except MemoryError as error:
        return _refuse(argv[0], f"out of memory: {error}")
    except BrokenPipeError:
        # The reader of our output (`| head`) has gone; leave quietly, and keep Python from flushing into it again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        if error.filename is None:
            raise
        return _refuse(argv[0], f"{error.filename}: {error.strerror}")
    except KeyboardInterrupt:
        print(f"gspure {argv[0]}: interrupted", file=sys.stderr)
        return 130


def _costed(args: Arguments) -> int:
    """Run a command; beside the log of its job, write its cost."""
    status = int(args.run(args) or 0)
    if log := os.environ.get(LOG):
        spent().write(cost_of(log))
    return status


def _refuse(command: str, reason: str) -> int:
    print(f"gspure {command}: {printable(reason)}", file=sys.stderr)
    return 2


def parser_of(name: str) -> argparse.ArgumentParser:
    """Return the parser of one command; the others are not imported."""
    module = _module(name)
    parser = Parser(
        prog=f"gspure {name}",
        description=module.HELP,
        epilog="examples:\n" + module.EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    module.add_arguments(parser)
    parser.set_defaults(run=module.run)
    return parser


def _overview(argv: Sequence[str]) -> NoReturn:
    """Print all commands or the version, or refuse a command line that does not begin with a command; exit."""
    commands = _listed("commands", USER_COMMANDS) + "\n\n" + _listed("jobs of the workflow", JOBS)
    parser = Parser(
        prog="gspure",
        usage="gspure [-h] [-V] COMMAND ...",
        description=f"{DESCRIPTION}\n\n{commands}",
        epilog="`gspure COMMAND --help` shows options and examples of one command; `gspure doctor` checks the set-up.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("-V", "--version", action="version", version=f"gspure {__version__}")
    if argv and not argv[0].startswith("-"):
        parser.error(f"no command {argv[0]!r}{suggestion(argv[0], COMMANDS)}")
    parser.parse_args(argv[:1] or ["--help"])
    parser.error("expected a command")


def _listed(title: str, names: Sequence[str]) -> str:
    return "\n".join([f"{title}:", *(f"  {name:<15}{_module(name).HELP}" for name in names)])


def _module(name: str) -> ModuleType:
    return importlib.import_module(f"gspure.cli.{name.replace('-', '_')}")
