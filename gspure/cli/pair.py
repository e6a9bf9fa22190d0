"""``gspure pair``: photographs of a scene and of a message, for `gspure embed`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from gspure.arrays import Float64, UInt8
from gspure.cameras import Camera, read_cameras, write_cameras
from gspure.cli.options import add_device, read_device, record_command
from gspure.cli.parser import Arguments, Parser
from gspure.constants import SH_DC
from gspure.errors import InputError
from gspure.files import filling
from gspure.images import is_flat, write_image
from gspure.model import Gaussians, read_model, require_finite
from gspure.model.ply import write_point_ply
from gspure.progress import say, track, warn
from gspure.renderer import Renderer
from gspure.scenes.alignment import Similarity, aligning
from gspure.scenes.lighting import bake
from gspure.scenes.photography import path_cameras, photograph
from gspure.scenes.procedural import NAMES, BuildScene, scene_builder
from gspure.scenes.rooms import PLACEMENTS, PROTOCOLS, message_transform
from gspure.settings import PAIR_VIEWS, SEED, TRACED_SIDE
from gspure.training.dataset import read_dataset, read_photographs

EXAMPLES = """\
  gspure pair room vault --out pair                       # ray-traced; placements: raised, front, behind, coincident
  gspure pair photos/garden trained/playroom --out pair   # photographs, and a model of the hidden scene
  gspure pair photos/garden photos/playroom --protocol own --out pair                # photographs of both

Writes cameras.json, points3D.ply and scene/VIEW.png of the scene, and the same of the message to message/.

shared  The message has the scene's poses. If it is not ray-traced, MESSAGE is a trained model, which is rendered there.
        The folder of a training run has cameras, by which the model is first aligned with the scene; a .ply keeps its
        coordinates, as in GS-Hider.
own     The message has poses of its own, which only the owner knows. Ray-traced messages are turned and moved;
        photographs keep their cameras, aligned with the scene.
"""

MESSAGE_POINTS = 20_000  # number of the message's Gaussians that serve as its points; ours
OPAQUE = 0.5  # least opacity of these Gaussians; ours


def add_arguments(parser: Parser) -> None:
    parser.text("scene", "SCENE", f"the visible scene: photographs as for `train`, or {NAMES}")
    meaning = f"the hidden scene: a trained model or its folder (photographs with --protocol own), or {NAMES}"
    parser.text("message", "MESSAGE", meaning)
    parser.writes("--out", "DIR", "folder of the pair")
    parser.choice("--protocol", PROTOCOLS, "poses of the message's views: the scene's, or its own", "shared")
    parser.text("--resolution", "RULE", "photographs' size, as for `train`", "320px")
    meaning = "ray-traced only: position of the message's surfaces relative to the scene's"
    parser.choice("--placement", PLACEMENTS, meaning, "raised")
    parser.number("--views", "N", "ray-traced only: number of views; every eighth is a test view", PAIR_VIEWS, 32)
    parser.number("--width", "PX", "ray-traced only: image width", TRACED_SIDE, 160)
    parser.number("--height", "PX", "ray-traced only: image height", TRACED_SIDE, 120)
    parser.number("--seed", "N", "random seed", SEED, 0)
    add_device(parser)


def run(args: Arguments) -> None:
    """Write the pair, all of it or nothing."""
    builders = [builder for name in (args.scene, args.message) if (builder := scene_builder(name))]
    if len(builders) == 1:
        expected = f"both of {NAMES}, or both files"
        raise InputError("pair", "SCENE and MESSAGE", expected=expected, found=f"{args.scene} and {args.message}")
    with filling(args.out) as args.out:
        if builders:
            _trace(args, *builders)
        else:
            views = _copy(args, "scene", args.scene)
            if args.protocol == "shared":
                _render(args, views)
            else:
                _copy(args, "message", args.message, views)
        record_command(args, args.out)


def _trace(args: Arguments, scene: BuildScene, message: BuildScene) -> None:
    """Ray-trace both."""
    views = path_cameras(args.views, args.width, args.height)
    rng = np.random.default_rng(args.seed)
    for kind, build, placement, transform in (
        ("scene", scene, "coincident", np.eye(4)),
        ("message", message, args.placement, message_transform(args.protocol)),
    ):
        xyz, rgb = photograph(bake(build(PLACEMENTS[placement])), views, args.out / kind, rng)
        moved = xyz @ transform[:3, :3].T + transform[:3, 3]
        _write(args.out, kind, [view.moved(transform) for view in views], moved, rgb)


def _copy(args: Arguments, kind: str, source: str, scene: Sequence[Camera] = ()) -> list[Camera]:
    """Write photographs, cameras and points of a capture, aligned with the views of the scene; return the cameras."""
    dataset = read_dataset(Path(source), args.resolution, seed=args.seed)
    views, xyz = sorted([*dataset.train, *dataset.test], key=lambda camera: camera.name), dataset.xyz
    for camera, image in zip(track(views, kind), read_photographs(views), strict=True):
        write_image(args.out / kind / f"{camera.name}.png", image)
    if scene:
        alignment = aligning(scene, views).inverse
        views, xyz = [alignment.camera(camera) for camera in views], alignment.points(xyz)
    _write(args.out, kind, views, xyz, dataset.rgb)
    return views


def _render(args: Arguments, views: Sequence[Camera]) -> None:
    """Render a trained model of the message at the poses of the scene."""
    model, folder = read_model(args.message), Path(args.message)
    require_finite(model, args.message)
    alignment = Similarity(1.0, np.eye(3), np.zeros(3))
    if folder.is_dir() and (folder / "cameras.json").is_file():
        alignment = aligning(views, read_cameras(folder / "cameras.json"))
        say(f"message aligned with the scene, scaled by {alignment.inverse.scale:.3g}")
    renderer = Renderer(model, read_device(args))
    empty = []
    for camera in track(views, "pair"):
        image = renderer.image(alignment.camera(camera))
        write_image(args.out / "message" / f"{camera.name}.png", image)
        empty += [camera.name] * is_flat(image)
    if empty:
        warn(f"{len(empty)} of {len(views)} views do not show the message (first: {empty[0]}): it lies outside of them")
    xyz, rgb = _points(model, args.seed)
    _write(args.out, "message", views, alignment.inverse.points(xyz), rgb)


def _points(model: Gaussians, seed: int) -> tuple[Float64, UInt8]:
    """Return centres [P,3] and 8-bit colours [P,3] of opaque Gaussians, in place of points."""
    opaque = np.flatnonzero(model.opacities >= OPAQUE)
    rows = np.sort(np.random.default_rng(seed).choice(opaque, min(MESSAGE_POINTS, len(opaque)), replace=False))
    colours = (0.5 + SH_DC * model.columns("f_dc_0", "f_dc_1", "f_dc_2")[rows]).clip(0, 1)
    return model.means[rows].astype(np.float64), np.round(255 * colours).astype(np.uint8)


def _write(out: Path, kind: str, views: Sequence[Camera], xyz: Float64, rgb: UInt8) -> None:
    """Write cameras and points of the scene or of the message."""
    folder = out if kind == "scene" else out / kind
    write_cameras(folder / "cameras.json", [replace(c, image=out / kind / f"{c.name}.png") for c in views])
    write_point_ply(folder / "points3D.ply", xyz, rgb)
