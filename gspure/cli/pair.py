"""``gspure pair``: photographs of a scene and of a message, for `gspure embed`."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np

from gspure.arrays import Float64, UInt8
from gspure.cameras import Camera, read_cameras, write_cameras
from gspure.cli.options import FORCE, add_device, require_empty_folder, selected_device
from gspure.cli.parser import Arguments, Parser
from gspure.constants import SH_DC
from gspure.errors import InputError
from gspure.files import filling_alone
from gspure.images import is_flat, write_image
from gspure.model import Gaussians, read_model, require_finite
from gspure.model.ply import write_point_ply
from gspure.progress import say, track, warn
from gspure.provenance import write_provenance
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


@dataclass(frozen=True)
class PairSettings:
    """The arguments of `gspure pair`, with their defaults."""

    scene: str
    message: str
    protocol: str = "shared"
    resolution: str = "320px"
    placement: str = "raised"
    views: int = 32
    width: int = 160
    height: int = 120
    seed: int = 0
    device: str | None = None


def add_arguments(parser: Parser) -> None:
    parser.text("scene", "SCENE", f"the visible scene: photographs as for `train`, or {NAMES}")
    meaning = f"the hidden scene: a trained model or its folder (photographs with --protocol own), or {NAMES}"
    parser.text("message", "MESSAGE", meaning)
    parser.writes("--out", "DIR", "folder of the pair")
    protocol = PairSettings.protocol
    parser.choice("--protocol", PROTOCOLS, "poses of the message's views: the scene's, or its own", protocol)
    parser.text("--resolution", "RULE", "photographs' size, as for `train`", PairSettings.resolution)
    meaning = "ray-traced only: position of the message's surfaces relative to the scene's"
    parser.choice("--placement", PLACEMENTS, meaning, PairSettings.placement)
    meaning = "ray-traced only: number of views; every eighth is a test view"
    parser.number("--views", "N", meaning, PAIR_VIEWS, PairSettings.views)
    parser.number("--width", "PX", "ray-traced only: image width", TRACED_SIDE, PairSettings.width)
    parser.number("--height", "PX", "ray-traced only: image height", TRACED_SIDE, PairSettings.height)
    parser.number("--seed", "N", "random seed", SEED, PairSettings.seed)
    parser.flag(*FORCE)
    add_device(parser)


def run(args: Arguments) -> None:
    """Write the pair; do not replace another, which the keys of models may name."""
    require_empty_folder(args)
    settings = {field.name: getattr(args, field.name) for field in fields(PairSettings)}
    make_pair(PairSettings(**settings), args.out)


def make_pair(settings: PairSettings, out: Path) -> None:
    """Write a pair and its provenance to a folder, all of it or nothing."""
    scene = scene_builder(settings.scene)
    message = scene_builder(settings.message)
    if bool(scene) != bool(message):
        expected = f"both of {NAMES}, or both files"
        names = f"{settings.scene} and {settings.message}"
        raise InputError("pair", "SCENE and MESSAGE", expected=expected, found=names)
    with filling_alone(out) as folder:
        if scene and message:
            _trace(settings, scene, message, folder)
        else:
            views = _copy(settings, "scene", settings.scene, folder)
            if settings.protocol == "shared":
                _render(settings, views, folder)
            else:
                _copy(settings, "message", settings.message, folder, views)
        write_provenance(folder, "pair", inputs={}, settings=asdict(settings))


def _trace(settings: PairSettings, scene: BuildScene, message: BuildScene, out: Path) -> None:
    """Ray-trace both."""
    views = path_cameras(settings.views, settings.width, settings.height)
    rng = np.random.default_rng(settings.seed)
    for kind, build, placement, transform in (
        ("scene", scene, "coincident", np.eye(4)),
        ("message", message, settings.placement, message_transform(settings.protocol)),
    ):
        xyz, rgb = photograph(bake(build(PLACEMENTS[placement])), views, out / kind, rng)
        moved = xyz @ transform[:3, :3].T + transform[:3, 3]
        _write(out, kind, [view.moved(transform) for view in views], moved, rgb)


def _copy(settings: PairSettings, kind: str, source: str, out: Path, scene: Sequence[Camera] = ()) -> list[Camera]:
    """Write photographs, cameras and points of a capture, aligned with the views of the scene; return the cameras."""
    dataset = read_dataset(Path(source), settings.resolution, seed=settings.seed)
    views = sorted([*dataset.train, *dataset.test], key=lambda camera: camera.name)
    xyz = dataset.xyz
    for camera, image in zip(track(views, kind), read_photographs(views), strict=True):
        write_image(out / kind / f"{camera.name}.png", image)
    if scene:
        alignment = aligning(scene, views).inverse
        views = [alignment.camera(camera) for camera in views]
        xyz = alignment.points(xyz)
    _write(out, kind, views, xyz, dataset.rgb)
    return views


def _render(settings: PairSettings, views: Sequence[Camera], out: Path) -> None:
    """Render a trained model of the message at the poses of the scene."""
    model = read_model(settings.message)
    folder = Path(settings.message)
    require_finite(model, settings.message)
    alignment = Similarity(1.0, np.eye(3), np.zeros(3))
    if folder.is_dir() and (folder / "cameras.json").is_file():
        alignment = aligning(views, read_cameras(folder / "cameras.json"))
        say(f"message aligned with the scene, scaled by {alignment.inverse.scale:.3g}")
    renderer = Renderer(model, selected_device(settings.device))
    empty = []
    for camera in track(views, "pair"):
        image = renderer.image(alignment.camera(camera))
        write_image(out / "message" / f"{camera.name}.png", image)
        if is_flat(image):
            empty.append(camera.name)
    if empty:
        warn(f"{len(empty)} of {len(views)} views do not show the message (first: {empty[0]}): it lies outside of them")
    xyz, rgb = _points(model, settings.seed)
    _write(out, "message", views, alignment.inverse.points(xyz), rgb)


def _points(model: Gaussians, seed: int) -> tuple[Float64, UInt8]:
    """Return centres [P,3] and 8-bit colours [P,3] of opaque Gaussians, in place of points."""
    opaque = np.flatnonzero(model.opacities >= OPAQUE)
    rng = np.random.default_rng(seed)
    rows = np.sort(rng.choice(opaque, min(MESSAGE_POINTS, len(opaque)), replace=False))
    colours = (0.5 + SH_DC * model.columns("f_dc_0", "f_dc_1", "f_dc_2")[rows]).clip(0, 1)
    return model.means[rows].astype(np.float64), np.round(255 * colours).astype(np.uint8)


def _write(out: Path, kind: str, views: Sequence[Camera], xyz: Float64, rgb: UInt8) -> None:
    """Write cameras and points of the scene or of the message."""
    folder = out if kind == "scene" else out / kind
    write_cameras(folder / "cameras.json", [replace(c, image=out / kind / f"{c.name}.png") for c in views])
    write_point_ply(folder / "points3D.ply", xyz, rgb)
