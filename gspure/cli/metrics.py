"""``gspure metrics``: PSNR and SSIM of two folders of images."""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "compare two folders of images: PSNR and SSIM, per view and mean"
EXAMPLES = """\
  gspure metrics before after
  gspure metrics photographs renders --reference truth --out metrics.csv
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    from gspure.evaluation.comparison import REFERENCES, RENDER

    parser.add_argument("images", type=Path, metavar="DIR_A", help="reference images; may hold more views than DIR_B")
    parser.add_argument(
        "other", type=Path, metavar="DIR_B", help="PNG files of the same names and sizes, in the same subfolders"
    )
    parser.add_argument(
        "--reference",
        choices=REFERENCES,
        default=RENDER,
        help="what DIR_A holds, to be told in the table: photographs of the truth, or renders of an unattacked model "
        "(default: %(default)s)",
    )
    parser.add_argument("--out", type=Path, metavar="CSV", help="also write target, view, reference, psnr, ssim here")


def run(args: argparse.Namespace) -> None:
    """Compare, print, and write the table."""
    from gspure.evaluation.comparison import as_text, compare, pair_images, write_metrics
    from gspure.progress import say, track

    pairs, surplus = pair_images(args.images, args.other)
    rows = [compare(pair, args.reference) for pair in track(pairs, "metrics")]
    print("\n".join(as_text(rows)))
    if surplus:
        say(f"metrics: {surplus} images of {args.images} have no counterpart in {args.other}")
    if args.out:
        write_metrics(args.out, rows)
