"""Files of other kinds that are taken for a model: what they are, by their first bytes, and what to do."""

import re
import zipfile
from pathlib import Path
from typing import Final

from gspure.errors import InputError

_UNPACK: Final = "unpack it, and name the model's file"
_EXPORT: Final = "export a .ply with the trainer, as by `ns-export gaussian-splat`"
_TRAIN: Final = "`gspure train` makes a model from photographs"
_AGAIN: Final = "download the file itself, on a web page its raw version"

_KINDS: Final = (
    (rb"version https://git-lfs", "a Git LFS pointer", "run `git lfs pull`", ""),
    (rb"\S*annex/objects/", "a git-annex pointer", "run `git annex get`", ""),
    (rb"\x1f\x8b", "a gzip archive", f"{_UNPACK}; one of SPZ is named .spz", ".spz"),
    (rb"NGSP", "an SPZ model", "name it .spz", ".spz"),
    (rb"\s*ply\s", "a PLY", "name it .ply", ".ply"),
    (rb"7z\xbc\xaf|Rar!|\xfd7zXZ|BZh\d|\x28\xb5\x2f\xfd|.{257}ustar", "an archive", _UNPACK, ""),
    (rb'\x80[\x02-\x05]|.{8}\{"', "a PyTorch checkpoint", _EXPORT, ""),
    (rb"\x93NUMPY|\x89HDF", "an array", _EXPORT, ""),
    (
        rb"\x89PNG|\xff\xd8\xff|GIF8|RIFF....WEBP|BM....\x00{4}|II\*\x00|MM\x00\*|v/1\x01|....ftyp",
        "a picture or a film",
        _TRAIN,
        "",
    ),
    (rb"glTF|solid\s|Kaydara|PXR-USDC|(?:#[^\n]*\n|\s)*(mtllib|usemtl|[ogs]|v[nt]?)\s", "a mesh", _TRAIN, ""),
    (rb"LASF|ASTM-E57|# \.PCD", "a point cloud", _TRAIN, ""),
    (rb"(\xef\xbb\xbf)?\s*<", "a web page", _AGAIN, ""),
    (rb"\s*[\[{]", "JSON", "name the model's file", ".json"),
    (rb"[\t\n\r -~]+\Z", "text", _AGAIN, ""),
)
"""Pattern of the first bytes, what it is, a remedy, and the suffix of files that may begin so."""


def recognized(path: Path, error: InputError) -> InputError:
    """Return the error of reading a model; if the file is of another kind, one that names it and a remedy."""
    what, hint = _kind(path) if path.is_file() else ("", "")
    return InputError(path, "file", expected=error.expected, found=what, hint=hint) if what else error


def _kind(path: Path) -> tuple[str, str]:
    """Return what a file is and a remedy; nothing if it may be of the kind that its suffix names."""
    with path.open("rb") as stream:
        head = stream.read(512)
    if not head:
        return "an empty file", "copy or download it again"
    if head.startswith(b"PK"):
        return _zipped(path)
    for pattern, what, hint, suffix in _KINDS:
        if re.match(pattern, head, re.DOTALL):
            text = f", {head.decode(errors='replace').strip()[:60]!r}" if what == "text" else ""
            return ("", "") if suffix == path.suffix.lower() else (what + text, hint)
    return "", ""


def _zipped(path: Path) -> tuple[str, str]:
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except (OSError, ValueError, zipfile.BadZipFile):
        return "an archive that was cut short", "copy or download it again"
    if any(name.endswith("data.pkl") for name in names):
        return "a PyTorch checkpoint", _EXPORT
    if any(name.endswith(".npy") for name in names):
        return "arrays of NumPy", _EXPORT
    if "meta.json" in names:
        return ("", "") if path.suffix.lower() == ".sog" else ("a SOG model", "name it .sog")
    return f"an archive of {', '.join(names[:3]) or 'nothing'}", _UNPACK
