"""Reading of cameras in all formats, recognized by content, and of transforms."""

import re
from fnmatch import fnmatch
from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import Float64, load_array
from gspure.cameras import inria, nerfstudio
from gspure.cameras.camera import Camera, require_rigid
from gspure.cameras.colmap import find_sparse, read_colmap
from gspure.cameras.entry import Entry
from gspure.cameras.orbit import GENERATED
from gspure.errors import InputError, reading
from gspure.files import read_json
from gspure.model import model_file
from gspure.progress import say

IN_FOLDER: Final = ("cameras.json", "transforms.json", "transforms_train.json")
COLMAP_FILES: Final = ("cameras.bin", "images.bin", "cameras.txt", "images.txt")
CAMERA_FILES: Final = (*COLMAP_FILES, *IN_FOLDER)  # of all formats that are read

_HEAD: Final = 4096  # bytes by which a file is recognized
_XML: Final = r"(<\?xml[^>]*>)?\s*"
_ROW: Final = r"(#.*\s+)*([-+.\dena]+[ \t,]+){%d}[-+.\dena]+[ \t]*[\r\n]+"  # one more number than the count
_EXPORT: Final = "export a COLMAP model from the program that wrote it"
_WRITE: Final = "write its poses and intrinsics into a transforms.json"

_FORMATS: Final = (
    ("*.xml", _XML + "<(document|chunk)", "Metashape", "`ns-process-data metashape`, or export COLMAP from Metashape"),
    ("*.xml", _XML + "<BlocksExchange", "ContextCapture", _EXPORT),
    ("*.csv", "#", "RealityCapture", "`ns-process-data realitycapture`, or export COLMAP from RealityCapture"),
    ("*.xmp", _XML + "<x:xmpmeta", "RealityCapture", "export COLMAP from RealityCapture"),
    ("*.out", "# *Bundle", "Bundler", _EXPORT),
    ("*.nvm", "NVM_V", "VisualSFM", _EXPORT),
    ("*.json", r'\s*\[\s*\{\s*"(cameras|shots|points|rig_|biases|reference)', "OpenSfM", "`opensfm export_colmap`"),
    ("*.json", r'\s*\{\s*"sfm_data_version"', "OpenMVG", "`openMVG_main_openMVG2Colmap`"),
    ("*", r'\s*\{[\s\S]*"(featuresFolders|sensorWidth|poseId)"', "Meshroom", "`aliceVision_exportColmap`"),
    ("*.json", r'\s*\{[\s\S]*"t_00"', "Polycam", "`ns-process-data polycam`"),
    ("*", r'\s*\{[\s\S]*"perFrameIntrinsicCoeffs"', "Record3D", "`ns-process-data record3d`"),
    ("*.json", r'\s*\{[\s\S]*"camera_path"', "nerfstudio's viewer (a path)", "name the transforms.json of the capture"),
    ("*poses*.npy", "", "LLFF", "name the COLMAP model that it was made from"),
    ("*camera*.npz", "", "NeuS or IDR", _WRITE),
    ("*intrinsic*.txt", "", "NSVF", _WRITE),
    ("*.txt", _ROW % 11, "KITTI", _WRITE),
    ("*.txt", _ROW % 7, "TUM", _WRITE),
    ("*.txt", (_ROW % 3) * 3, "NSVF", _WRITE),
    ("*.log", (_ROW % 2) + (_ROW % 3) * 4, "Tanks and Temples", _WRITE),
    ("*.db", "SQLite", "COLMAP's database, without poses", "name the sparse model that `colmap mapper` makes of it"),
    ("*.ps[xz]", "", "Metashape (a project)", "export COLMAP from Metashape"),
    ("*.r[cs]proj", "", "RealityCapture (a project)", "export COLMAP from RealityCapture"),
)
"""Pattern of the file name in lower case, pattern of the beginning, program, and a way to convert its cameras."""

_LISTED: Final = 8  # most folders in an error


def read_cameras(path: str | Path) -> list[Camera]:
    """Read the cameras of a file or folder as `read_lenses` does; raise `InputError` for a distorted one.

    >>> camera = gspure.read_cameras("cameras.json")[0]
    >>> camera.width, camera.height, camera.viewmat.shape
    (48, 36, (4, 4))
    """
    if str(path) in GENERATED and not Path(path).exists():
        hint = f"gspure.cameras.{GENERATED[str(path)].__name__}(model) generates views"
        raise InputError("read_cameras", "path", expected="a file or folder", found=repr(str(path)), hint=hint)
    cameras = read_lenses(path)
    for camera in cameras:
        if camera.distortion:
            coefficients = " ".join(f"{value:g}" for value in camera.distortion)
            hint = "undistort first: gspure cameras SOURCE --undistort --out FOLDER/cameras.json"
            raise InputError(path, f"{camera.name}.distortion", expected="none", found=coefficients, hint=hint)
    return cameras


def read_lenses(path: str | Path) -> list[Camera]:
    """Read the cameras of a file or folder, in its order, with the distortion of their lenses.

    `path` is a cameras.json of 3DGS or of ours, a transforms.json of nerfstudio, Instant NGP or Blender, the poses of
    ``ns-export cameras``, or a folder. A folder holds a COLMAP sparse model (in itself, ``sparse/0`` or ``sparse``),
    which has priority since it names photographs, or one of those files; or one of its subfolders, up to two levels
    deeper, does. Raise `InputError` if there are no cameras, or a field is invalid.
    """
    path = Path(path)
    place = camera_place(path)
    if path.is_dir() and not place_in(path):
        say(f"{path}: reading {place}")
    return read_colmap(place) if place.is_dir() else _read_file(place)


def _read_file(path: Path) -> list[Camera]:
    """Read the cameras of a file."""
    refuse_foreign(path)
    content = read_json(path)
    match content:
        case [{"transform": _}, *_]:
            return nerfstudio.parse_poses(path, content)
        case list():
            return inria.parse(path, content)
        case {"frames": _}:
            return nerfstudio.parse(path, content)
    kind = "something else"
    hint = None
    if isinstance(content, dict):
        kind = f"an object with {', '.join(content) or 'nothing'}"
        hint = "a single camera? Put [ ] around it" if "img_name" in content else None
    raise InputError(path, "file", expected="a list of cameras, or an object with frames", found=kind, hint=hint)


def camera_object(source: Path) -> Entry | None:
    """Return the JSON object in a camera file, or in that of a folder, such as a transforms.json; else None."""
    path = camera_place(source)
    if path.is_dir():
        return None
    content = read_json(path)
    return Entry(path, "", content) if isinstance(content, dict) else None


def read_transform(path: Path) -> Float64:
    """Read the similarity transform [4,4] of ``gspure attack --transform``."""
    matrix = load_array(path, dtype=np.float64, shape=(4, 4))
    transform = Entry(path, "", {"array": matrix.tolist()}).array("array", (4, 4))
    scale = np.cbrt(max(np.linalg.det(transform[:3, :3]), 0)) or 1
    require_rigid(path, "array", transform / [[scale], [scale], [scale], [1]])
    return transform


def camera_place(source: Path) -> Path:
    """Return the camera file of a path, or the folder of its COLMAP sparse model.

    A folder without either stands for that in its subfolders, if there is exactly one.
    """
    if not source.is_dir():
        return source.parent if source.name in COLMAP_FILES else source
    places = camera_places(source)
    if len(places) == 1:
        return places[0]
    if not places:
        refuse_foreign(source)
    expected = f"a COLMAP sparse model, {', '.join(IN_FOLDER[:-1])} or {IN_FOLDER[-1]}"
    if places:
        names = ", ".join(str(path.relative_to(source)) for path in places)
        raise InputError(source, "folder", expected=expected, found=names, hint="name one of them")
    folders = ", ".join(sorted(path.name for path in source.iterdir() if path.is_dir())[:_LISTED])
    hint = f"its folders are {folders}" if folders else None
    raise InputError(source, "folder", expected=expected, found="none of them", hint=hint)


def camera_places(folder: Path) -> list[Path]:
    """Return the camera file or sparse model of a folder, or else those of its subfolders, up to two levels deeper."""
    for pattern in ("", "*", "*/*"):
        folders = sorted(filter(Path.is_dir, folder.glob(pattern))) if pattern else [folder]
        places = dict.fromkeys(filter(None, map(place_in, folders)))
        if places:
            return [*places]
    return []


def place_in(folder: Path) -> Path | None:
    """Return the camera file or sparse model of a folder itself, if it has one."""
    files = (folder / name for name in IN_FOLDER)
    return find_sparse(folder) or next((file for file in files if file.is_file()), None)


def default_cameras(model: Path, *folders: Path) -> Path | str:
    """Return the place of cameras: one of the `folders`, that of the model or that of its training run; else orbit."""
    found = model_file(model)
    beside = found if found.is_dir() else found.parent  # chunks of a model are a folder
    run_folder = beside.parents[1] if beside.match("point_cloud/iteration_*") else beside
    return next(filter(place_in, [*folders, beside, run_folder]), "orbit")


def refuse_foreign(path: Path) -> None:
    """Refuse a camera file of another program, or a folder with one, and any other foreign file, with a remedy."""
    expected = "cameras of 3DGS, COLMAP or nerfstudio"
    for file in sorted(path.glob("*")) if path.is_dir() else [path]:
        candidates = [row for row in _FORMATS if fnmatch(file.name.lower(), row[0])]
        if not file.is_file() or not (candidates or file == path):
            continue
        with reading(file, "cameras"), file.open("rb") as stream:
            head = stream.read(_HEAD).decode("utf-8-sig", errors="replace")
        for _, beginning, program, remedy in candidates:
            if re.match(beginning, head):
                origin = f"those of {program}" if file == path else f"those of {program} in {file.name}"
                raise InputError(path, "format", expected=expected, found=origin, hint=remedy)
        if file == path and file.suffix.lower() != ".json" and not head.lstrip().startswith(("[", "{")):
            raise InputError(path, "format", expected=expected, found="a file of another kind", hint=_EXPORT)
