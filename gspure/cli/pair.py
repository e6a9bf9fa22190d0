"""``gspure pair``: photographs of a scene and of a message, for `gspure embed`."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gspure.cli.options import add_device, read_device
from gspure.errors import InputError

if TYPE_CHECKING:
    from gspure.cameras import Camera
    from gspure.model import Gaussians

HELP = "make a pair: photographs of a scene and of a message from the same poses, for `gspure embed`"
EXAMPLES = """\
  gspure pair room vault --out pair                       # ray-traced; placements: raised, front, behind, coincident
  gspure pair room vault --placement coincident --out pair --views 48 --width 320 --height 240
  gspure pair photos/garden trained/playroom --out pair   # photographs, and a model of the hidden scene

Writes cameras.json, points3D.ply, scene/VIEW.png, message/VIEW.png and message/points3D.ply. With photographs of the
scene, the message is a trained model rendered at their poses. The output folder of a training run has cameras too, so
its model is first aligned with the scene; a single .ply is used in its own coordinates, as GS-Hider does.
"""

MESSAGE_POINTS = 20_000
"""Number of the message's Gaussians that serve as its points. Ours."""

OPAQUE = 0.5
"""Least opacity of these Gaussians. Ours."""

_LEAST = {"seed": 0, "views": 2, "width": 16, "height": 16, "off_path": 0}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    from gspure.scenes import PLACEMENTS, STAGES

    stages = ", ".join(STAGES)
    parser.add_argument("scene", metavar="SCENE", help=f"the visible scene: photographs as for `train`, or {stages}")
    parser.add_argument(
        "message", metavar="MESSAGE", help=f"the hidden scene: a trained model or its folder, or {stages}"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder of the pair")
    parser.add_argument(
        "--resolution", default="320px", metavar="RULE", help="photographs' size, as for `train` (default: %(default)s)"
    )
    parser.add_argument(
        "--placement",
        choices=PLACEMENTS,
        default="raised",
        help="ray-traced only: position of the message's surfaces relative to the scene's (default: %(default)s)",
    )
    parser.add_argument(
        "--views", type=int, default=32, metavar="N", help="ray-traced only: number of views (default: %(default)s)"
    )
    parser.add_argument(
        "--width", type=int, default=160, metavar="PX", help="ray-traced only: image width (default: %(default)s)"
    )
    parser.add_argument(
        "--height", type=int, default=120, metavar="PX", help="ray-traced only: image height (default: %(default)s)"
    )
    parser.add_argument(
        "--off-path",
        type=int,
        default=0,
        metavar="N",
        help="ray-traced only: also photograph N views off the camera path, as `gspure cameras --off-path` does",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="random seed (default: %(default)s)")
    add_device(parser)


def run(args: argparse.Namespace) -> None:
    """Write the pair."""
    from gspure.artifacts import write_provenance
    from gspure.scenes import STAGES

    for name, least in _LEAST.items():
        if getattr(args, name) < least:
            raise InputError(
                "pair", f"--{name.replace('_', '-')}", expected=f"at least {least}", found=str(getattr(args, name))
            )
    if (args.scene in STAGES) != (args.message in STAGES):
        expected = f"both of {', '.join(STAGES)}, or both files"
        raise InputError("pair", "SCENE and MESSAGE", expected=expected, found=f"{args.scene} and {args.message}")
    settings = _traced(args) if args.scene in STAGES else _photographed(args)
    for name in ("cameras.json", "points3D.ply"):
        write_provenance(args.out / name, inputs={}, settings=settings)


def _traced(args: argparse.Namespace) -> dict[str, Any]:
    import numpy as np

    from gspure.cameras import off_path_cameras, write_cameras
    from gspure.model.points import write_point_ply
    from gspure.scenes import Staging, stage_cameras
    from gspure.scenes.photography import photograph, picture

    views = stage_cameras(args.views, args.width, args.height)
    aside = off_path_cameras(views, args.off_path)
    staging = Staging(args.scene, args.message, args.placement)
    rng = np.random.default_rng(args.seed)
    for kind, lit in (("scene", staging.lit_scene()), ("message", staging.lit_message())):
        points = photograph(lit, views, args.out / kind, rng)
        write_point_ply(args.out / ("." if kind == "scene" else kind) / "points3D.ply", *points)
        picture(lit, aside, args.out / kind)
    write_cameras(args.out / "cameras.json", _named(views, args.out))
    names = ("scene", "message", "placement", "views", "width", "height", "off_path", "seed")
    return {name: getattr(args, name) for name in names}


def _photographed(args: argparse.Namespace) -> dict[str, Any]:
    from gspure.cameras import write_cameras
    from gspure.images import write_image
    from gspure.model import read_model, require_finite
    from gspure.model.points import write_point_ply
    from gspure.progress import track
    from gspure.renderer import Renderer
    from gspure.training.dataset import read_dataset, read_photographs

    dataset = read_dataset(Path(args.scene), args.resolution, seed=args.seed)
    model = read_model(args.message)
    require_finite(model, args.message)
    views = sorted([*dataset.train, *dataset.test], key=lambda camera: camera.name)
    move = _move(views, Path(args.message))
    renderer = Renderer(model, read_device(args))
    for camera, image in zip(track(views, "pair"), read_photographs(views), strict=True):
        write_image(args.out / "scene" / f"{camera.name}.png", image)
        write_image(args.out / "message" / f"{camera.name}.png", renderer.image(move.camera(camera)))
    write_point_ply(args.out / "points3D.ply", dataset.xyz, dataset.rgb)
    xyz, rgb = _points(model, args.seed)
    write_point_ply(args.out / "message" / "points3D.ply", move.inverse(xyz), rgb)
    write_cameras(args.out / "cameras.json", _named(views, args.out))
    return {name: str(getattr(args, name)) for name in ("scene", "message", "resolution", "seed")}


def _named(views: list[Camera], folder: Path) -> list[Camera]:
    """Return the views with the photographs that lie in the pair's folder."""
    return [replace(camera, image=folder / "scene" / f"{camera.name}.png") for camera in views]


def _move(views: list[Camera], message: Path) -> Any:
    """Return how the scene's world lies in the message's: aligned by the cameras of both where there are any."""
    import numpy as np

    from gspure.cameras import read_cameras
    from gspure.progress import say
    from gspure.scenes.alignment import Similarity, aligning

    if message.is_dir() and (message / "cameras.json").is_file():
        move = aligning(views, read_cameras(message / "cameras.json"))
        say(f"message aligned with the scene, scaled by {1 / move.scale:.3g}")
        return move
    return Similarity(1.0, np.eye(3), np.zeros(3))


def _points(model: Gaussians, seed: int) -> tuple[Any, Any]:
    """Return centres [P,3] and 8-bit colours [P,3] of opaque Gaussians, in place of points."""
    import numpy as np

    from gspure.constants import SH_DC

    opaque = np.flatnonzero(model.opacities >= OPAQUE)
    rows = np.sort(np.random.default_rng(seed).choice(opaque, min(MESSAGE_POINTS, len(opaque)), replace=False))
    colours = (0.5 + SH_DC * model.columns("f_dc_0", "f_dc_1", "f_dc_2")[rows]).clip(0, 1)
    return model.means[rows].astype(np.float64), np.round(255 * colours).astype(np.uint8)
