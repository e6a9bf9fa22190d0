"""Public benchmark captures: their archives, downloaded and unpacked as training reads them.

The publishers give no digests. Archives differ in the image size at which the 3DGS papers evaluate each capture.
"""

import zipfile
from pathlib import Path, PurePosixPath
from typing import BinaryIO, Final, NamedTuple

from gspure.errors import InputError, reading
from gspure.files import digest, filling
from gspure.provenance import write_provenance

_TIMEOUT: Final = 30.0


class Archive(NamedTuple):
    """A zip file of captures, each a COLMAP project, in its folder `folder`.

    `terms` are the known terms of use, in a sentence or two; `photographs` is the folder of the photographs in the size
    at which papers evaluate.
    """

    url: str
    terms: str
    photographs: str
    folder: str = ""


_MIPNERF360 = (
    "Mip-NeRF 360 (Barron et al., CVPR 2022), https://jonbarron.info/mipnerf360: no licence is stated, so assume "
    "research use only, and no right to redistribute."
)
_DEEP_BLENDING = (
    "Playroom of Deep Blending (Hedman et al., SIGGRAPH Asia 2018), as prepared by the authors of 3DGS: see the terms "
    "at https://repo-sam.inria.fr/fungraph/3d-gaussian-splatting."
)
_V2: Final = "https://storage.googleapis.com/gresearch/refraw360/360_v2.zip"
_EXTRA: Final = "https://storage.googleapis.com/gresearch/refraw360/360_extra_scenes.zip"
_TANDT_DB: Final = "https://repo-sam.inria.fr/fungraph/3d-gaussian-splatting/datasets/input/tandt_db.zip"

SCENES: Final = {
    **dict.fromkeys(("bicycle", "garden", "stump"), Archive(_V2, _MIPNERF360, "images_4")),
    **dict.fromkeys(("bonsai", "counter", "kitchen", "room"), Archive(_V2, _MIPNERF360, "images_2")),
    **dict.fromkeys(("flowers", "treehill"), Archive(_EXTRA, _MIPNERF360, "images_4")),
    "playroom": Archive(_TANDT_DB, _DEEP_BLENDING, "images", folder="db"),
}
"""Image sizes are those of the 3DGS papers: outdoor scenes at a quarter, indoor scenes at a half, others in full."""


def fetch(url: str, folder: Path) -> Path:
    """Download a file into a folder, unless it exists; an interrupted download of the same version is continued.

    Raise `InputError` if the server does not have the file, or the connection breaks.
    """
    import requests

    file = folder / url.rpartition("/")[2]
    if file.is_file():
        return file
    folder.mkdir(parents=True, exist_ok=True)
    try:
        head = requests.head(url, timeout=_TIMEOUT, allow_redirects=True)
        head.raise_for_status()
        version = head.headers.get("ETag", "")
        size = int(head.headers.get("Content-Length", 0))
        part = file.with_name(f"{file.name}.{digest(version, str(size))}.part")
        with part.open("ab") as stream:
            if stream.tell() < size:
                _append(url, stream, version)
            if not stream.tell() == size > 0:
                raise requests.ConnectionError(f"{stream.tell()} of {size} bytes")
    except requests.RequestException as error:
        raise InputError(url, "download", expected="an answer", found=str(error)) from None
    part.replace(file)
    return file


def _append(url: str, stream: BinaryIO, version: str) -> None:
    """Append the missing part of a version of a file; if the server has another version, download all of that."""
    import requests

    headers = {"Accept-Encoding": "identity", "Range": f"bytes={stream.tell()}-", "If-Range": version}
    with requests.get(url, headers=headers, stream=True, timeout=_TIMEOUT) as response:
        response.raise_for_status()
        if response.status_code != requests.codes.partial_content:
            stream.truncate(0)
        stream.writelines(response.iter_content(1 << 16))


def extract(file: Path, archive: Archive, scene: str, folder: Path) -> None:
    """Unpack a scene of an archive's `file` as a COLMAP project, ``images/`` and ``sparse/``, whole or not at all.

    Raise `InputError` if the archive is corrupt or lacks the scene. `zipfile` lets no entry leave the folder.
    """
    root = PurePosixPath(archive.folder, scene)
    with filling(folder) as whole, reading(file, "a zip archive"), zipfile.ZipFile(file) as stored:
        for top, name in ((archive.photographs, "images"), ("sparse", "sparse")):
            entries = [entry for entry in stored.namelist() if entry.startswith(f"{root / top}/")]
            if not entries:
                raise InputError(file, scene, expected=f"files in {root / top}", found="none")
            stored.extractall(whole, entries)
            (whole / root / top).rename(whole / name)
        write_provenance(whole, "download", inputs={}, settings={"url": archive.url, "images": archive.photographs})
