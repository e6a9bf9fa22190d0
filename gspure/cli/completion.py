"""``gspure completion``: the script by which a shell completes commands, options and files."""

import argparse
from pathlib import Path

from gspure.cli.options import camera_source
from gspure.cli.parser import Arguments, Parser

EXAMPLES = """\
  gspure completion bash      # > ~/.local/share/bash-completion/completions/gspure
  gspure completion zsh       # > ~/.zfunc/_gspure, a folder of $fpath
"""


def add_arguments(parser: Parser) -> None:
    parser.add_argument("shell", choices=("bash", "zsh", "fish", "tcsh"), help="shell")


def run(args: Arguments) -> None:
    """Print the script of one parser of all commands, in which arguments that name files are completed by files."""
    from gspure.cli import COMMANDS, parser_of
    from gspure.plugins import require_packages

    require_packages({"shtab": "shtab>=1.7"}, "completion")
    import shtab

    whole = argparse.ArgumentParser(prog="gspure")
    commands = whole.add_subparsers()
    for name in COMMANDS:
        parser = parser_of(name)
        outputs = parser.get_default("outputs") or ()
        for action in parser._actions:  # noqa: SLF001 (argparse lists them nowhere else)
            if action.type in {Path, camera_source} or action.dest in outputs:
                vars(action)["complete"] = shtab.FILE
        commands.add_parser(name, help=parser.description, parents=[parser], add_help=False)
    print(shtab.complete(whole, args.shell))
