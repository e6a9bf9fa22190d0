"""``gspure download``: public benchmark scenes."""

from pathlib import Path

from gspure.cli.options import add_quiet
from gspure.cli.parser import Arguments, Parser
from gspure.datasets import SCENES, archive_of, extract, fetch, is_complete
from gspure.errors import InputError
from gspure.progress import say

EXAMPLES = """\
  gspure download all --accept-licence                      # into data/, for config/mipnerf360.yaml
  gspure download garden playroom --out data --accept-licence

Each scene becomes a COLMAP project DIR/SCENE whose `images` are the photographs that papers evaluate on (images_4 of
outdoor scenes, images_2 of indoor scenes); `gspure train --resolution photographs` uses them at that size. An
interrupted download resumes from DIR/archives; delete the archives once everything is unpacked.

Nothing is downloaded before you accept the publishers' terms; without --accept-licence the command prints them.
Unpacked files are checked against the checksums in the archive.
"""

ALL = "all"


def add_arguments(parser: Parser) -> None:
    parser.text("scenes", "SCENE", f"{ALL}, or some of {', '.join(SCENES)}", nargs="+")
    parser.writes("--out", "DIR", "folder for the scenes", default=Path("data"))
    parser.flag("--accept-licence", "you have read the publishers' terms and accept them")
    add_quiet(parser)


def run(args: Arguments) -> None:
    scenes = SCENES if ALL in args.scenes else tuple(dict.fromkeys(args.scenes))
    archives = {scene: archive_of(scene) for scene in scenes}
    missing = [scene for scene in scenes if not is_complete(args.out / scene)]
    if missing and not args.accept_licence:
        terms = " ".join(dict.fromkeys(archives[scene].terms for scene in missing))
        raise InputError("download", "--accept-licence", expected="your consent", found="none", hint=terms)
    for scene in missing:
        file = fetch(archives[scene].url, args.out / "archives")
        extract(file, archives[scene], scene, args.out / scene)
        say(f"{args.out / scene}: {archives[scene].photographs[scene]} of {file.name}")
