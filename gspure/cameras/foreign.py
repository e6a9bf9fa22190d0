"""Camera files of other programs: recognized, so that an error can name a way to convert them."""

import re
from fnmatch import fnmatch
from pathlib import Path
from typing import Final

from gspure.errors import InputError, reading

_HEAD: Final = 4096  # bytes by which a file is recognized
_XML: Final = r"(<\?xml[^>]*>)?\s*"
_ROW: Final = r"(#.*\s+)*([-+.\dena]+[ \t,]+){%d}[-+.\dena]+[ \t]*[\r\n]+"  # of this many numbers and one more
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
"""Pattern of the name in lower case, beginning, format, and a way to convert it."""


def refuse_foreign(path: Path) -> None:
    """Refuse a file of another program or kind, or a folder that holds cameras of one, with a way to convert them."""
    expected = "cameras of 3DGS, COLMAP or nerfstudio"
    for file in sorted(path.glob("*")) if path.is_dir() else [path]:
        known = [row for row in _FORMATS if fnmatch(file.name.lower(), row[0])]
        if not file.is_file() or not (known or file == path):
            continue
        with reading(file, "cameras"), file.open("rb") as stream:
            head = stream.read(_HEAD).decode("utf-8-sig", errors="replace")
        for name, way in (row[2:] for row in known if re.match(row[1], head)):
            found = f"those of {name}" + (f" in {file.name}" if file != path else "")
            raise InputError(path, "format", expected=expected, found=found, hint=way)
        if file == path and file.suffix.lower() != ".json" and not head.lstrip().startswith(("[", "{")):
            raise InputError(path, "format", expected=expected, found="a file of another kind", hint=_EXPORT)
