"""Files of other kinds that are taken for a model: what they are, by their first bytes, and what to do."""

import re
from pathlib import Path
from typing import Final

from gspure.errors import InputError

_UNPACK: Final = "unpack it, and name the model's file"
_EXPORT: Final = "export a .ply with the trainer, as by `ns-export gaussian-splat`"
_TRAIN: Final = "`gspure train` makes a model from photographs"
_AGAIN: Final = "download the file itself, on a web page its raw version"

_KINDS: Final = (
    (rb"\Z", "an empty file", "copy or download it again", None),
    (rb"version https://git-lfs", "a Git LFS pointer", "run `git lfs pull`", None),
    (rb"\S*annex/objects/", "a git-annex pointer", "run `git annex get`", None),
    (rb"\x1f\x8b", "a gzip archive", f"{_UNPACK}; one of SPZ is named .spz", ".spz"),
    (rb"NGSP", "an SPZ model", "name it .spz", ".spz"),
    (rb"PK.*(meta\.json|\.webp)", "a SOG model", "name it .sog", ".sog"),
    (rb"\s*ply\s", "a PLY", "name it .ply", ".ply"),
    (rb'PK.*data\.pkl|\x80[\x02-\x05]|.{8}\{"', "a PyTorch checkpoint", _EXPORT, None),
    (rb"PK.*\.npy|\x93NUMPY|\x89HDF", "arrays", _EXPORT, None),
    (rb"PK|7z\xbc\xaf|Rar!|\xfd7zXZ|BZh\d|\x28\xb5\x2f\xfd|.{257}ustar", "an archive", _UNPACK, None),
    (rb"\x89PNG|\xff\xd8\xff|GIF8|RIFF....WEBP|BM....\x00{4}|II\*\x00|MM\x00\*", "a picture", _TRAIN, None),
    (rb"....ftyp", "a film or picture", _TRAIN, None),
    (rb"glTF|solid\s|Kaydara|PXR-USDC|(?:#[^\n]*\n|\s)*(mtllib|usemtl|[ogs]|v[nt]?)\s", "a mesh", _TRAIN, None),
    (rb"LASF|ASTM-E57|# \.PCD", "a point cloud", _TRAIN, None),
    (rb"(\xef\xbb\xbf)?\s*<", "a web page", _AGAIN, None),
    (rb"\s*[\[{]", "JSON", "name the model's file", ".json"),
    (rb"[^\x00-\x08\x0b\x0c\x0e-\x1f]+\Z", "text", _AGAIN, None),
)
"""Pattern of the first bytes, what it is, a remedy, and the suffix of files that may begin so."""


def recognized(path: Path, error: InputError) -> InputError:
    """Return the error of reading a model; if the file is of another kind, one that names it and a remedy."""
    if not path.is_file():
        return error
    with path.open("rb") as stream:
        head = stream.read(512)
    kinds = (kind for kind in _KINDS if re.match(kind[0], head, re.DOTALL))
    _, what, hint, suffix = next(kinds, (b"", "", "", ""))
    if not what or suffix == path.suffix.lower():
        return error
    found = f"text, {head[:60].decode(errors='replace').strip()!r}" if what == "text" else what
    return InputError(path, "file", expected=error.expected, found=found, hint=hint)
