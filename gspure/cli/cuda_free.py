"""``gspure cuda-free``: run a program that was written for CUDA."""

import os
import shutil
from pathlib import Path

from gspure.cli import options
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError
from gspure.progress import say
from gspure_torch.cuda_free.dialects import DIALECTS, find_wrapper, read_dialect
from gspure_torch.cuda_free.replacement import NAMES, Replacement, environment, extensions_of

EXAMPLES = """\
  gspure cuda-free -- python train.py -s garden -m trained
  gspure cuda-free --dialect inria-2023 -- python train.py -s garden -m trained
  gspure cuda-free --device cpu -- python render.py -m trained

Run this in the program's folder. The exit status is that of the program.
"""

_DEFAULT = "inria"


def add_arguments(parser: Parser) -> None:
    meaning = "what its rasterizer takes and returns (default: as its own wrapper in this folder says, else inria)"
    parser.choice("--dialect", DIALECTS, meaning)
    options.add_device(parser)
    parser.usage = "gspure cuda-free [options] -- PROGRAM ..."
    parser.set_defaults(passed_on=[])  # what follows `--`


def run(args: Arguments) -> None:
    """Become the program."""
    from gspure.opencl.device import DEVICE_VARIABLE, choose_device
    from gspure_torch.cuda_free.mapping import target_device

    words: list[str] = args.passed_on
    if not words:
        raise InputError("command line", "program", expected="one after --", found="none")
    folder = Path.cwd()
    wrapper = None if args.dialect else find_wrapper(folder)
    dialect = read_dialect(wrapper) if wrapper else DIALECTS[args.dialect or _DEFAULT]
    replacement = Replacement(dialect, extensions_of(folder))
    device = choose_device(args.device)
    variables = environment(replacement, os.environ) | {DEVICE_VARIABLE: str(device.index)}
    origin = wrapper.relative_to(folder) if wrapper else args.dialect or f"{_DEFAULT}, as no wrapper is here"
    parts = [
        f"cuda-free: {', '.join(NAMES)} are gspure's, on {device.name}",
        f"dialect {origin}",
        f"PyTorch's cuda is {target_device()}, with {variables['OMP_NUM_THREADS']} threads",
    ]
    if replacement.refused:
        parts.append(f"not replaced: {', '.join(replacement.refused)}")
    say("; ".join(parts))
    if not shutil.which(words[0], path=variables["PATH"]):
        raise InputError(words[0], "program", expected="an executable file", found="none")
    os.execvpe(words[0], words, variables)  # noqa: S606 -- the program that the user names
