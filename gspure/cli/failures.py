"""``gspure failures``: what a run of the workflow could not make."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

HELP = "tell what of a run failed, and why"
EXAMPLES = """\
  gspure failures results                                  # status 1 if anything failed
  gspure failures results/vanilla/bicycle/gspure/public/point_cloud.ply
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("paths", type=Path, nargs="+", metavar="PATH", help="files, or folders with all below them")


def run(args: argparse.Namespace) -> int:
    """Print the files and folders that failed, by reason."""
    from gspure.failures import failed_below, note_of

    reasons: dict[str, list[Path]] = {}
    for path in args.paths:
        for failed in failed_below(path):
            reasons.setdefault(note_of(failed).reason, []).append(failed)
    for reason, files in reasons.items():
        others = f" and {len(files) - 1} more" if len(files) > 1 else ""
        print(f"{reason}: {os.path.relpath(files[0])}{others}")
    return 1 if reasons else 0
