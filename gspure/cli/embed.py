"""``gspure embed``: hide a message in a scene by training."""

import time
from dataclasses import asdict
from pathlib import Path

from gspure.cli import options
from gspure.cli.pair import PairSettings, make_pair
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError
from gspure.files import file_digest, filling_alone, write_json
from gspure.model import is_trained_model
from gspure.progress import say
from gspure.provenance import write_provenance
from gspure.scenes.procedural import scene_builder
from gspure.schemes.commitment import COMMITMENT, Commitment
from gspure.schemes.pair import INITIALIZATIONS, read_pair
from gspure.schemes.readability import readability_of
from gspure.schemes.registry import BUILT_IN, find_scheme
from gspure.schemes.scheme import hide
from gspure.settings import SEED, parsed_settings

EXAMPLES = """\
  gspure embed splats_in_splats pair --out marked                          # after `gspure pair room vault --out pair`
  gspure embed splats_in_splats pair --out clean --set message_weight=0    # a clean model, without a key
  gspure embed keyed_pattern pair --out marked                             # bits, the reference defence
  gspure embed splats_in_splats --scene photos/garden --message photos/desk --out marked   # the pair: marked/pair

Writes public/, the public model, and key/, the owner's key, with readability.json: how much of the message is legible
with this key and with a wrong one, in a few training views. A warning is printed if the message is not readable.
Have commitment.json dated by somebody else when you publish the model: this proves that the key already existed.
"""


def add_arguments(parser: Parser) -> None:
    parser.text("scheme", "SCHEME", "one of the schemes below, or of an installed plug-in")
    options.list_choices(parser, "schemes", BUILT_IN)
    parser.reads("pair", "PAIR", "output folder of `gspure pair`; or --scene and --message", nargs="?")
    parser.text("--scene", "SCENE", "the visible scene, as for `gspure pair`: it makes the pair first, in DIR/pair")
    meaning = (
        "the scene to hide (not by schemes of bits): photographs, at poses of their own, or what `gspure pair` takes"
    )
    parser.text("--message", "MESSAGE", meaning)
    parser.text("--resolution", "RULE", "with --scene: photographs' size, as for `train`", "320px")
    parser.writes("--out", "DIR", "folder for public/ and key/")
    parser.pairs("--set", "NAME=VALUE", "a setting of the scheme")
    meaning = "initial points: of scene and message, or of the scene alone"
    parser.choice("--initialization", INITIALIZATIONS, meaning, "both")
    parser.number("--seed", "N", "random seed", SEED, 0)
    parser.flag(*options.FORCE)
    options.add_device(parser)


def run(args: Arguments) -> None:
    """Embed; write public model and key, both or neither."""
    options.require_empty_folder(args)  # an older key could not be made again
    scheme = find_scheme(args.scheme)
    settings = parsed_settings(f"scheme {scheme.name}", scheme.embed, dict(args.set))
    makes_pair = bool(args.scene)
    if bool(args.message) != makes_pair or bool(args.pair) == makes_pair:
        raise InputError("embed", "PAIR", expected="a pair, or --scene and --message", found="neither or both")
    resolved = {"set": scheme.settings | settings, "pair": args.out / "pair" if makes_pair else args.pair}
    model = Path("public", "point_cloud.ply")
    with filling_alone(args.out) as folder:
        if makes_pair:
            make_pair(_pair_settings(args), folder / "pair")
        pair = read_pair(folder / "pair" if makes_pair else args.pair, args.initialization)
        poses = "the same poses" if pair.shares_poses else "poses of its own"
        say(f"{len(pair.scene.views)} views, message at {poses}, {len(pair.points[0])} points")
        began = time.monotonic()
        device = options.read_device(args)
        public, key = hide(scheme, pair, seed=args.seed, device=device, **settings)
        check = readability_of(scheme, pair, public, key, device) if key else None
        files = public.write(folder / model)
        run_id = file_digest(files[0])[:16]
        # Without settings, since the seed may give the key away.
        write_provenance(folder / "public", "embed", inputs={}, settings={"scheme": scheme.name}, run=run_id)
        options.record_command(args, folder, run_id, resolved)
        if key is not None:
            key.write(folder / "key")
            write_json(folder / COMMITMENT, asdict(Commitment.of(scheme.name, files[0], folder / "key")))
            options.record_command(args, folder / "key", run_id, resolved)
        if check:
            write_json(folder / "key" / "readability.json", asdict(check))
        options.remove_older(args.out, "public/*", "key/*", COMMITMENT)  # perhaps of another scheme
        if makes_pair:
            options.remove_older(args.out, "pair/**/*")
    say(f"embedded in {time.monotonic() - began:.0f} s: {len(public.model)} rows in {args.out / model}")
    if check:
        check.report()


def _pair_settings(args: Arguments) -> PairSettings:
    """Return the settings of the pair to make; photographs of the message keep their poses."""
    has_poses = not (scene_builder(args.message) or is_trained_model(args.message))
    return PairSettings(
        args.scene,
        args.message,
        protocol="own" if has_poses else "shared",
        resolution=args.resolution,
        seed=args.seed,
        device=args.device,
    )
