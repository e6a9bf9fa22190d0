"""``gspure message``: the planted message that a model still holds."""

from __future__ import annotations

import argparse
from pathlib import Path

from gspure.errors import InputError

HELP = "extract the planted message from a model, with the owner's key"
EXAMPLES = """\
  gspure message planted/public/point_cloud.ply --key planted/key/planted_key.npz --out message.ply
  gspure message purified.ply --key planted/key/planted_key.npz --out message.ply    # then render it
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("model", type=Path, metavar="MODEL", help="public or attacked model: 3DGS .ply, or its folder")
    parser.add_argument("--key", type=Path, required=True, metavar="NPZ", help="planted_key.npz, from `gspure plant`")
    parser.add_argument("--out", type=Path, required=True, metavar="PLY", help="the message as a model")


def run(args: argparse.Namespace) -> None:
    """Extract and write."""
    from gspure.model import read_model, write_model
    from gspure.progress import say
    from gspure.scenes import read_key, reveal

    model, key = read_model(args.model), read_key(args.key)
    if model.sh_degree < 0:
        raise InputError(args.model, "f_dc_0", expected="spherical-harmonic colour", found="none")
    message = reveal(model, key)
    write_model(args.out, message)
    say(f"message: {len(message)} of the {len(key.rows)} Gaussians that carry it are left")
