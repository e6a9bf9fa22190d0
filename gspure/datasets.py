"""Public benchmark captures: their archives, downloaded and unpacked as training reads them.

The publishers give no digests. Archives differ in the image size at which the 3DGS papers evaluate each capture.
"""

import shutil
import time
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any, Final

from gspure.errors import InputError, reading
from gspure.files import PROVENANCE, digest, filling, write_provenance

TRIES: Final = 5  # number of consecutive connections without progress after which a download fails
_TIMEOUT: Final = 30.0


@dataclass(frozen=True)
class Archive:
    """A zip file of captures, each a COLMAP project, in a `folder` of the archive.

    `terms` are the known terms of use, in a sentence or two; `photographs` are, by scene, the folder of the photographs
    that papers evaluate on.
    """

    url: str
    terms: str
    photographs: Mapping[str, str] = field(hash=False)
    folder: str = ""


_MIPNERF360 = (
    "Mip-NeRF 360 (Barron et al., CVPR 2022), https://jonbarron.info/mipnerf360: no licence is stated, so assume "
    "research use only, and no right to redistribute."
)
_DEEP_BLENDING = (
    "Playroom of Deep Blending (Hedman et al., SIGGRAPH Asia 2018), as prepared by the authors of 3DGS: see the terms "
    "at https://repo-sam.inria.fr/fungraph/3d-gaussian-splatting."
)
_INDOOR: Final = ("bonsai", "counter", "kitchen", "room")
_OUTDOOR: Final = ("bicycle", "garden", "stump")

ARCHIVES: Final = (
    Archive(
        "https://storage.googleapis.com/gresearch/refraw360/360_v2.zip",
        _MIPNERF360,
        dict.fromkeys(_OUTDOOR, "images_4") | dict.fromkeys(_INDOOR, "images_2"),
    ),
    Archive(
        "https://storage.googleapis.com/gresearch/refraw360/360_extra_scenes.zip",
        _MIPNERF360,
        dict.fromkeys(("flowers", "treehill"), "images_4"),
    ),
    Archive(
        "https://repo-sam.inria.fr/fungraph/3d-gaussian-splatting/datasets/input/tandt_db.zip",
        _DEEP_BLENDING,
        {"playroom": "images"},
        folder="db",
    ),
)
"""As the 3DGS papers: outdoor scenes at a quarter of their size, indoor scenes at a half, Deep Blending as it is."""

SCENES: Final = tuple(scene for archive in ARCHIVES for scene in archive.photographs)


def archive_of(scene: str) -> Archive:
    """Return the archive that holds a scene, or raise `InputError` if none does."""
    for archive in ARCHIVES:
        if scene in archive.photographs:
            return archive
    raise InputError("download", "SCENE", expected=f"one of {', '.join(SCENES)}", found=scene)


def is_complete(folder: Path) -> bool:
    """Return whether a folder holds a capture, which is unpacked whole or not at all."""
    return (folder / PROVENANCE).is_file()


def fetch(url: str, folder: Path) -> Path:
    """Download a file into a folder unless it is there; an interrupted download resumes.

    Raise `InputError` if the server does not have the file, or the connection breaks repeatedly.
    """
    import pooch
    import requests

    name = url.rpartition("/")[2]
    pooch.get_logger().setLevel("ERROR")  # it warns that the file has no known digest
    try:
        return Path(pooch.retrieve(url, None, fname=name, path=folder, downloader=partial(_resume, folder / name)))
    except requests.RequestException as error:
        raise InputError(url, "download", expected="an answer", found=str(error)) from None


def extract(file: Path, archive: Archive, scene: str, folder: Path) -> None:
    """Unpack one scene of an archive's `file` as a COLMAP project, ``images/`` and ``sparse/``, all of it or nothing.

    Raise `InputError` if the archive is corrupt, lacks the scene, or has an entry that leads out of its folder.
    """
    root = PurePosixPath(archive.folder, scene)
    with filling(folder) as whole, reading(file, "a zip archive"), zipfile.ZipFile(file) as stored:
        for top, name in ((archive.photographs[scene], "images"), ("sparse", "sparse")):
            entries = [entry for entry in stored.infolist() if entry.filename.startswith(f"{root / top}/")]
            if not entries:
                raise InputError(file, scene, expected=f"files in {root / top}", found="none")
            for entry in (entry for entry in entries if not entry.is_dir()):
                path = PurePosixPath(entry.filename).relative_to(root / top)
                if ".." in path.parts:
                    raise InputError(file, entry.filename, expected="a file below its folder", found="a path out of it")
                target = whole / name / path
                target.parent.mkdir(parents=True, exist_ok=True)
                with stored.open(entry) as source, target.open("wb") as copy:
                    shutil.copyfileobj(source, copy)
        settings = {"url": archive.url, "images": archive.photographs[scene]}
        write_provenance(whole, "download", inputs={}, settings=settings)


def _resume(file: Path, url: str, output: str, _: Any) -> None:
    """Download to `output`; what an interrupted download left beside `file` is continued if it is of this version."""
    import requests

    head = requests.head(url, timeout=_TIMEOUT, allow_redirects=True)
    head.raise_for_status()
    total, version = int(head.headers.get("Content-Length", 0)), head.headers.get("ETag", "")
    part = file.with_name(f"{file.name}.{digest(version, str(total))}.part")
    part.touch()
    fruitless = 0
    while (size := part.stat().st_size) < total and fruitless < TRIES:
        try:
            _append(url, part, version)
        except (requests.ConnectionError, requests.Timeout, requests.exceptions.ChunkedEncodingError):
            time.sleep(fruitless)
        fruitless = 0 if part.stat().st_size > size else fruitless + 1
    if part.stat().st_size != total or not total:
        raise requests.ConnectionError(f"{part.stat().st_size} of {total} bytes")
    part.replace(output)


def _append(url: str, part: Path, version: str) -> None:
    """Request the missing part of one version of a file; a server with another version sends all of that."""
    import requests

    size = part.stat().st_size if version else 0
    headers = {"Accept-Encoding": "identity", "Range": f"bytes={size}-", "If-Range": version}
    with requests.get(url, headers=headers if size else {}, stream=True, timeout=_TIMEOUT) as response:
        response.raise_for_status()
        with part.open("ab" if response.status_code == requests.codes.partial_content else "wb") as stream:
            for chunk in response.iter_content(1 << 16):
                stream.write(chunk)
