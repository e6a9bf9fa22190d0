"""``gspure metrics``: PSNR and SSIM of two folders of images."""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "compare two folders of images: PSNR and SSIM, per view and mean"
EXAMPLES = """\
  gspure metrics truth renders
  gspure metrics truth renders --out metrics.csv
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument(
        "reference", type=Path, metavar="DIR_A", help="reference images; may hold more views than DIR_B"
    )
    parser.add_argument(
        "other", type=Path, metavar="DIR_B", help="PNG files of the same names and sizes, in the same subfolders"
    )
    parser.add_argument("--out", type=Path, metavar="CSV", help="also write target, view, psnr, ssim here")


def run(args: argparse.Namespace) -> None:
    """Compare, print, and write the table."""
    from gspure.evaluation.comparison import as_text, compare, pair_images, write_metrics
    from gspure.progress import say, track

    pairs, surplus = pair_images(args.reference, args.other)
    rows = [compare(pair) for pair in track(pairs, "metrics")]
    print("\n".join(as_text(rows)))
    if surplus:
        say(f"metrics: {surplus} images of {args.reference} have no counterpart in {args.other}")
    if args.out:
        write_metrics(args.out, rows)
