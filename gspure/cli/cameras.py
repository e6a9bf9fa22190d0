"""``gspure cameras``: convert or generate cameras; write cameras.json."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from gspure.cameras import Camera, scaled, split, write_cameras
from gspure.cameras.photographs import TRAINING_RULE, missing_photographs
from gspure.cameras.points import stored_points
from gspure.cameras.reading import read_lenses
from gspure.cameras.undistortion import undistort
from gspure.cli.options import QUIET, add_up, camera_source, read_source, record_command
from gspure.cli.parser import Arguments, Parser
from gspure.errors import InputError
from gspure.files import filling
from gspure.grouping import grouped
from gspure.model.ply import write_point_ply
from gspure.settings import FIELD_OF_VIEW, SIDE, VIEWS

EXAMPLES = """\
  gspure cameras scene/sparse/0 --out cameras.json                    # COLMAP; at most 1600 pixels wide, as 3DGS trains
  gspure cameras scene --undistort --out flat/cameras.json            # without lens distortion, to flat/images
  gspure cameras orbit --model point_cloud.ply --out cameras.json --count 48 --up 0 1 0
"""

_SETTINGS = ("count", "width", "height", "fov_degrees", "up")


def add_arguments(parser: Parser) -> None:
    meaning = (
        "cameras.json, transforms.json (nerfstudio, Blender), or a folder with one of them or a COLMAP sparse model; "
        "or `orbit` or `shells` to generate views around --model"
    )
    parser.reads("source", "SOURCE", meaning, type=camera_source)
    parser.writes("--out", "JSON", "the cameras.json to write")
    meaning = "image size: native; 1/N; or Wpx, at most W pixels wide (default: 1600px, or native for generated views)"
    parser.text("--resolution", "RULE", meaning)
    parser.flag("--undistort", "remove lens distortion; the photographs go to images/ beside --out, with the points")
    views = parser.add_argument_group("generated views (SOURCE `orbit` or `shells`)")
    views.add_argument("--model", type=Path, metavar="MODEL", help="the model to look at")
    parser.number("--count", "N", "number of views (default: orbit 24, shells 48)", VIEWS, group=views)
    parser.number("--width", "PX", "image width (default: 640)", SIDE, group=views)
    parser.number("--height", "PX", "image height (default: 480)", SIDE, group=views)
    meaning = "horizontal field of view (default: 50)"
    parser.number("--fov", "DEGREES", meaning, FIELD_OF_VIEW, group=views, dest="fov_degrees")
    add_up(parser, group=views)
    parser.flag(*QUIET)


def run(args: Arguments) -> None:
    """Read or generate the views, scale and write them, print a table."""
    generated = isinstance(args.source, str)
    if args.model and not generated:
        raise InputError(args.source, "source", expected="orbit or shells", found="a camera file and --model")
    if args.undistort:
        cameras = _undistorted(args)
    else:
        settings = {name: getattr(args, name) for name in _SETTINGS}
        cameras = read_source(args.source, args.model, **settings)
        default_rule = "native" if generated else TRAINING_RULE
        cameras = scaled(cameras, args.resolution or default_rule)
    write_cameras(args.out, cameras)
    record_command(args, args.out.parent)
    print("\n".join(_table(cameras)))


def _undistorted(args: Arguments) -> list[Camera]:
    """Write photographs and points of a capture without lens distortion beside ``--out``; return their cameras."""
    source = args.source
    place = args.out.parent
    images = Path("images")
    if isinstance(source, str):
        raise InputError(source, "--undistort", expected="cameras with photographs", found="generated views")
    cameras = read_lenses(source)
    folder = place.resolve()
    capture = (source if source.is_dir() else source.parent).resolve()
    photographs = {parent for camera in cameras if camera.image for parent in camera.image.resolve().parents}
    if folder == capture or folder / images in photographs:
        raise InputError(args.out, "--undistort", expected="a folder apart from the capture", found=str(folder))
    xyz, rgb = stored_points(source)
    with filling(place) as temporary:
        if len(xyz):
            write_point_ply(temporary / "points3D.ply", xyz, rgb)
        cameras = undistort(scaled(cameras, args.resolution or TRAINING_RULE), temporary / images, source)
    return [replace(camera, image=place / images / f"{camera.name}.png") for camera in cameras]


def _table(cameras: Sequence[Camera]) -> Iterable[str]:
    """Yield a heading and one line per image size and focal length."""
    _, held_out = split(cameras)
    tests = {camera.name for camera in held_out}
    yield f"{'views':>6}{'train':>7}{'test':>6}  {'size':<11}{'focal':>8}{'fov':>7}{'photographs':>13}"
    alike = grouped(cameras, lambda camera: (camera.width, camera.height, float(camera.K[0, 0])))
    for (width, height, focal), views in sorted(alike.items()):
        test = sum(view.name in tests for view in views)
        fov = math.degrees(2 * math.atan(width / 2 / focal))
        photographs = len(views) - len(missing_photographs(views))
        numbers = f"{len(views):>6}{len(views) - test:>7}{test:>6}"
        yield f"{numbers}  {f'{width}x{height}':<11}{focal:>8.1f}{fov:>6.1f}°{photographs:>13}"
