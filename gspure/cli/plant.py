"""``gspure plant``: generate a scene with a planted message."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from gspure.errors import InputError

HELP = "generate a model with a planted message and known ground truth for every Gaussian"
EXAMPLES = """\
  gspure plant --out planted
  gspure plant --out planted --scene room --message vault --placement coincident --gaussians 30000 --seed 1

Writes public/point_cloud.ply, cameras.json, key/planted_key.npz (private opacity and colour), key/carriers.npy (bool
[K], true for Gaussians of the message), ray-traced photographs truth/scene/VIEW.png and truth/message/VIEW.png, and
points3D.ply, points on the scene's surfaces. `gspure train` accepts the folder.
"""

_LEAST = {"seed": 0, "gaussians": 100, "views": 1, "width": 16, "height": 16}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="output folder")
    parser.add_argument("--scene", default="room", help="the visible scene: room or vault (default: %(default)s)")
    parser.add_argument("--message", default="vault", help="the hidden scene: room or vault (default: %(default)s)")
    parser.add_argument(
        "--placement",
        default="raised",
        help="position of the message's surfaces relative to the scene's: raised (floor and walls slightly nearer), "
        "front (only a floor, higher up), behind, or coincident (default: %(default)s)",
    )
    parser.add_argument(
        "--gaussians",
        type=int,
        default=24000,
        metavar="N",
        help="number of Gaussians, scene and message together (default: %(default)s)",
    )
    parser.add_argument("--views", type=int, default=24, metavar="N", help="number of views (default: %(default)s)")
    parser.add_argument("--width", type=int, default=320, metavar="PX", help="image width (default: %(default)s)")
    parser.add_argument("--height", type=int, default=240, metavar="PX", help="image height (default: %(default)s)")
    parser.add_argument(
        "--off-path",
        type=int,
        default=0,
        metavar="N",
        help="also photograph N views off the camera path, as `gspure cameras --off-path` does",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="random seed (default: %(default)s)")


def run(args: argparse.Namespace) -> None:
    """Plant, photograph and write."""
    import numpy as np

    from gspure.artifacts import save_array, write_provenance
    from gspure.cameras import off_path_cameras, write_cameras
    from gspure.model import write_model
    from gspure.model.points import write_point_ply
    from gspure.progress import say
    from gspure.scenes import plant, write_key
    from gspure.scenes.photography import photograph, picture

    for name, least in _LEAST.items():
        if getattr(args, name) < least:
            raise InputError("plant", f"--{name}", expected=f"at least {least}", found=str(getattr(args, name)))
    names = ("scene", "message", "placement", "gaussians", "views", "width", "height", "seed")
    settings = {name: getattr(args, name) for name in names}
    planted = plant(**settings)
    truth = args.out / "truth"
    cameras = [replace(camera, image=truth / "scene" / f"{camera.name}.png") for camera in planted.cameras]
    points = photograph(planted.scene, cameras, truth / "scene", np.random.default_rng(args.seed))
    photograph(planted.message, cameras, truth / "message", np.random.default_rng(args.seed))
    aside = off_path_cameras(cameras, args.off_path)
    picture(planted.scene, aside, truth / "scene")
    picture(planted.message, aside, truth / "message")
    made = ("cameras.json", "points3D.ply", "key/planted_key.npz", "key/carriers.npy", "public/point_cloud.ply")
    views, cloud, key, carriers, model = (args.out / name for name in made)
    write_cameras(views, cameras)
    write_point_ply(cloud, *points)
    write_key(key, planted.key)
    save_array(carriers, planted.carries_message)
    write_model(model, planted.public)
    for path in (views, cloud, key, carriers, model):
        write_provenance(path, inputs={}, settings=settings)
    say(f"planted: {len(planted.key.rows)} of {len(planted.public)} Gaussians carry the message")
