"""``gspure render``: images of a model."""

from __future__ import annotations

import argparse
from pathlib import Path

from gspure.cli.options import (
    add_device,
    add_energy,
    add_off_path,
    add_scheme,
    add_views,
    read_asset,
    read_device,
    read_views,
)
from gspure.errors import InputError

HELP = "render a model's views to images"
EXAMPLES = """\
  gspure render point_cloud.ply --cameras cameras.json --out renders
  gspure render point_cloud.ply --cameras cameras.json --out renders --split test --npy --background 1 1 1
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument(
        "model", type=Path, metavar="MODEL", help="the model's .ply, or the output folder of a training run"
    )
    add_scheme(parser)
    add_views(parser, split="all")
    add_off_path(parser)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for VIEW.png")
    parser.add_argument("--npy", action="store_true", help="also write VIEW.npy: float32 [H,W,3], not clipped")
    parser.add_argument(
        "--background",
        type=float,
        nargs=3,
        default=(0.0, 0.0, 0.0),
        metavar=("R", "G", "B"),
        help="colour behind the model, 0 to 1 (default: black)",
    )
    add_energy(parser, default="ewa")
    add_device(parser)


def run(args: argparse.Namespace) -> None:
    """Render every view."""
    from gspure.artifacts import save_array
    from gspure.images import write_image
    from gspure.progress import track

    if not all(0 <= channel <= 1 for channel in args.background):
        found = " ".join(map(str, args.background))
        raise InputError("render", "--background", expected="three numbers from 0 to 1", found=found)
    views = read_views(args)
    asset = read_asset(args)
    scene = asset.scene(read_device(args), tuple(args.background), args.energy)
    for camera in track(views, "render"):
        image = scene(camera)
        write_image(args.out / f"{camera.name}.png", image)
        if args.npy:
            save_array(args.out / f"{camera.name}.npy", image)
