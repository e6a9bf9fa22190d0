"""``gspure download``: public benchmark scenes."""

from pathlib import Path

from gspure.cli.options import QUIET
from gspure.cli.parser import Arguments, Parser
from gspure.datasets import SCENES, extract, fetch
from gspure.errors import InputError
from gspure.progress import say
from gspure.provenance import PROVENANCE

EXAMPLES = """\
  gspure download all --accept-licence                      # into data/, for experiments/mipnerf360.yaml
  gspure download garden playroom --out data --accept-licence

Each scene becomes a COLMAP project DIR/SCENE whose `images` are the photographs that papers evaluate on (images_4 of
outdoor scenes, images_2 of indoor scenes); `gspure train --resolution photographs` uses them at that size. An
interrupted download resumes from DIR/archives; delete the archives once everything is unpacked.

Nothing is downloaded before you accept the publishers' terms; without --accept-licence the command prints them.
Unpacked files are checked against the checksums in the archive.
"""

ALL = "all"


def add_arguments(parser: Parser) -> None:
    meaning = f"{ALL}, or some of {', '.join(SCENES)}"
    parser.text("scenes", "SCENE", meaning, nargs="+", choices=(ALL, *SCENES))
    parser.writes("--out", "DIR", "folder for the scenes", default=Path("data"))
    parser.flag("--accept-licence", "you have read the publishers' terms and accept them")
    parser.flag(*QUIET)


def run(args: Arguments) -> None:
    """Download and unpack the scenes that the folder lacks."""
    scenes = SCENES if ALL in args.scenes else dict.fromkeys(args.scenes)
    missing = {scene: SCENES[scene] for scene in scenes if not (args.out / scene / PROVENANCE).is_file()}
    if missing and not args.accept_licence:
        terms = " ".join(dict.fromkeys(archive.terms for archive in missing.values()))
        raise InputError("download", "--accept-licence", expected="your consent", found="none", hint=terms)
    for scene, archive in missing.items():
        file = fetch(archive.url, args.out / "archives")
        extract(file, archive, scene, args.out / scene)
        say(f"{args.out / scene}: {archive.photographs} of {file.name}")
