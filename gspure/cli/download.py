"""``gspure download``: the captures that the field compares on."""

from __future__ import annotations

import argparse
from pathlib import Path

from gspure.errors import InputError

HELP = "download scenes of Mip-NeRF 360, and Playroom of Deep Blending: what config/mipnerf360.yaml takes"
EXAMPLES = """\
  gspure download all --accept-licence                      # to data/: what config/mipnerf360.yaml takes
  gspure download garden playroom --out data --accept-licence

Each becomes a COLMAP project DIR/SCENE, with the photographs that papers compare on (images_4 of outdoor scenes,
images_2 of indoor scenes, as published) as `images`; `--resolution photographs` of `gspure train` takes them at that
size. Archives are kept in DIR/archives: a download that was cut off goes on from there, and they may be deleted when
all is unpacked.

Nothing is downloaded before you accept the publishers' terms; without --accept-licence the command tells what they are.
No publisher gives a digest: that of the first download is written beside the archive and checked from then on. Files
that are unpacked are checked against the checksums in the archive.
"""

ALL = "all"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    from gspure.datasets import SCENES

    parser.add_argument("scenes", nargs="+", metavar="SCENE", help=f"{ALL}, or some of {', '.join(SCENES)}")
    parser.add_argument(
        "--out", type=Path, default=Path("data"), metavar="DIR", help="folder of the scenes (default: %(default)s)"
    )
    parser.add_argument(
        "--accept-licence", action="store_true", help="you have read the publishers' terms and keep to them"
    )


def run(args: argparse.Namespace) -> None:
    """Download the archives and unpack the scenes that are not there yet."""
    from gspure.datasets import SCENES, archive_of, extract, fetch
    from gspure.datasets.extraction import RECORD
    from gspure.progress import say

    scenes = SCENES if ALL in args.scenes else tuple(dict.fromkeys(args.scenes))
    archives = {scene: archive_of(scene) for scene in scenes}
    missing = [scene for scene in scenes if not (args.out / scene / RECORD).is_file()]
    if missing and not args.accept_licence:
        terms = " ".join(dict.fromkeys(archives[scene].terms for scene in missing))
        raise InputError("download", "--accept-licence", expected="your consent", found="none", hint=terms)
    for scene in missing:
        file, sha256 = fetch(archives[scene].url, args.out / "archives")
        extract(file, archives[scene], scene, args.out / scene, sha256=sha256)
        say(f"{args.out / scene}: {archives[scene].photographs[scene]} of {file.name}")
