"""``gspure embed``: hide a message in a scene by training."""

import time
from dataclasses import asdict
from pathlib import Path

from gspure.cli import options
from gspure.cli.parser import Arguments, Parser
from gspure.evaluation.outcomes import BITS
from gspure.files import file_digest, filling, write_json, write_provenance
from gspure.progress import say
from gspure.schemes.pair import INITIALIZATIONS, read_pair
from gspure.schemes.readability import Readability, bit_readability, readability
from gspure.schemes.registry import BUILT_IN, find_scheme
from gspure.schemes.scheme import hide
from gspure.settings import SEED, parsed_settings

EXAMPLES = """\
  gspure embed splats_in_splats pair --out marked                          # after `gspure pair room vault --out pair`
  gspure embed splats_in_splats pair --out clean --set message_weight=0    # a clean model, without a key

Writes public/, the public model, and key/, the owner's key, with readability.json: the PSNR of the message and of
negative controls in a few training views. A warning is printed if the message does not stand out from them.
gs_hider, secure_gs and keyss need PyTorch: pip install gspure[torch].
"""


def add_arguments(parser: Parser) -> None:
    parser.text("scheme", "SCHEME", "one of the schemes below, or of an installed plug-in")
    options.list_choices(parser, "schemes", BUILT_IN)
    parser.reads("pair", "PAIR", "output folder of `gspure pair`")
    parser.writes("--out", "DIR", "folder for public/ and key/")
    parser.pairs("--set", "NAME=VALUE", "a setting of the scheme")
    meaning = "initial points: of scene and message, or of the scene alone"
    parser.choice("--initialization", INITIALIZATIONS, meaning, "both")
    parser.number("--seed", "N", "random seed", SEED, 0)
    parser.flag(*options.FORCE)
    options.add_device(parser)


def run(args: Arguments) -> None:
    """Embed; write public model and key, both or neither."""
    options.require_own_folder(args)
    scheme = find_scheme(args.scheme)
    settings = parsed_settings(f"scheme {scheme.name}", scheme.embed, dict(args.set))
    pair = read_pair(args.pair, initialization=args.initialization)
    poses = "the same poses" if pair.shares_poses else "poses of its own"
    say(f"{len(pair.scene.views)} views, message at {poses}, {len(pair.points[0])} points")
    began = time.monotonic()
    device = options.read_device(args)
    model = Path("public", "point_cloud.ply")
    args.set = scheme.settings | settings
    with filling(args.out) as folder:
        public, key = hide(scheme, pair, seed=args.seed, device=device, **settings)
        check: Readability | None = None
        if key is not None and BITS in scheme.extractions:
            check = bit_readability(pair.scene.views, public, key, device)
        elif key is not None:
            check = readability(pair.message, public, key, device)
        run = file_digest(public.write(folder / model)[0])[:16]
        # Without settings, since the seed may give the key away.
        write_provenance(folder / "public", "embed", inputs={}, settings={"scheme": scheme.name}, run=run)
        options.record_command(args, folder, run)
        if key is not None:
            key.write(folder / "key")
            options.record_command(args, folder / "key", run)
        if check:
            write_json(folder / "key" / "readability.json", asdict(check) | {"readable": check.readable})
        options.remove_older(args.out, "public/*", "key/*")  # perhaps of another scheme
    say(f"embedded in {time.monotonic() - began:.0f} s: {len(public.model)} rows in {args.out / model}")
    if check:
        check.report()
