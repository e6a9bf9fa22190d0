"""The command line: one module per subcommand.

A command module holds ``EXAMPLES`` (shown below the options), ``add_arguments(parser)`` and ``run(args)``;
`gspure.cli.parser` has the kinds of arguments. So that ``--help`` stays quick, imports that take long stand inside
functions.
"""

import argparse
import errno
import importlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from gspure import __version__, progress
from gspure.cli.parser import Arguments, Parser, suggestion
from gspure.errors import InputError, error_line

COMMANDS = {
    "demo": "hide a scene in another, attack the model, extract the message: a verdict and a report, in minutes",
    "audit": "attack a model in many ways: a verdict about its message, and a report, in the current folder",
    "purify": "run GSPure on one model: purified model, weights, clusters, metrics and figures",
    "view": "show a model in 3-D, or two side by side: one page, for any browser",
    "embed": "train a watermarked model on a pair: the public model and the owner's key",
    "extract": "render the message of a public or attacked model with the owner's key",
    "train": "train a 3DGS model from photographs",
    "doctor": "check OpenCL devices, OpenGL and packages; with --fix, install what is missing",
    "info": "summarize a model: counts, extents, quantiles, suspicious rows, detected scheme",
    "scan": "look for hidden content in a model without a key, and compare the model with clean ones",
    "render": "render a model's views to images",
    "metrics": "compare two folders of images by all metrics, such as PSNR and SSIM: mean, worst view, every view",
    "cameras": "convert cameras of any supported format, or generate views, and write cameras.json",
    "attack": "apply one attack or control to a model: prune, change or move its Gaussians",
    "detect": "read bits from images with a scheme's key, or bits or scores with a program of your own",
    "forge": "measure how far claims on a stranger's clean model get, without the owner's key",
    "pair": "make a pair: photographs of a scene and of a message, for `gspure embed`",
    "download": "download the scenes of Mip-NeRF 360, and Playroom of Deep Blending",
    "report": "write tables, figures and report of a run, even if it failed or is running",
    "compare": "put two audits beside each other: before and after a change of a scheme",
    "submit": "write the radii of a run of a suite as one record for the leaderboard",
    "check-plugin": "check that a scheme, an attack or a detector keeps the rules for plug-ins",
    "cuda-free": "run a program that was written for CUDA, such as the trainer of 3DGS, without CUDA",
    "completion": "print a script for tab completion in a shell",
}
FIRST = 8  # that a person types; the others are listed as further tools

DESCRIPTION = "Measure how robust a 3D Gaussian Splatting watermark is against GSPure and other attacks."


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; bad input gives one line on standard error and exit status 2, an interruption 130."""
    argv = sys.argv[1:] if argv is None else argv
    if not argv or argv[0] not in COMMANDS:
        _overview(argv)
    args: Arguments | None = None
    try:
        args = parser_of(argv[0]).parse_args(argv[1:])
        progress.quiet = getattr(args, "quiet", False)
        with progress.warnings_in_lines():
            status = args.run(args)
            sys.stdout.flush()
        return int(status or 0)
    except KeyboardInterrupt:
        progress.tell(f"gspure {argv[0]}: interrupted")
        return 130
    except BrokenPipeError:  # the reader of our output (`| head`) has gone
        progress.silence(sys.stdout)
        return 1
    except (InputError, MemoryError, OSError) as error:
        if isinstance(error, InputError):
            if isinstance(file := getattr(args, error.source, None), Path):  # the source may be the name of an argument
                error.source = str(file)
        elif isinstance(error, OSError) and error.errno == errno.ENOSPC and not error.filename:  # our files have names
            progress.silence(sys.stdout)
            error.filename = "standard output"
        progress.tell(f"gspure {argv[0]}: {error_line(error)}")
        return 2


def parser_of(name: str) -> argparse.ArgumentParser:
    """Return the parser of one command; the others are not imported."""
    module = importlib.import_module(f"gspure.cli.{name.replace('-', '_')}")
    parser = Parser(
        prog=f"gspure {name}",
        description=COMMANDS[name],
        epilog="examples:\n" + module.EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    module.add_arguments(parser)
    parser.set_defaults(run=module.run, verb=name)
    return parser


def _overview(argv: Sequence[str]) -> NoReturn:
    """Print all commands or the version, or refuse a command line that does not begin with a command; exit."""
    lines = [f"  {name:<15}{meaning}" for name, meaning in COMMANDS.items()]
    commands = "\n".join([*lines[:FIRST], "\nmore tools:", *lines[FIRST:]])
    parser = Parser(
        prog="gspure",
        usage="gspure [-h] [-V] COMMAND ...",
        description=f"{DESCRIPTION}\n\ncommands:\n{commands}",
        epilog="`gspure COMMAND --help` shows options and examples of one command; `gspure doctor` checks the set-up.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("-V", "--version", action="version", version=f"gspure {__version__}")
    if argv and not argv[0].startswith("-"):
        parser.error(f"no command {argv[0]!r}{suggestion(argv[0], COMMANDS)}")
    parser.parse_args(argv[:1] or ["--help"])
    parser.error("expected a command")
