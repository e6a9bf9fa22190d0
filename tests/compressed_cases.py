"""A model in compressed formats: files of splat-transform 2.7.1, and of formats that it does not write.

All hold `blobs(12, sh_degree=2)`, those of splat-transform in another order. The others are written after the
descriptions of their formats: .splat, SPZ 2 and SOG 1.
"""

import zipfile
from pathlib import Path

from gspure.model import Gaussians
from tests.models import blobs

SPLAT_TRANSFORM = Path(__file__).with_name("splat_transform")
OLDER_FORMATS = Path(__file__).with_name("older_formats")


def model() -> Gaussians:
    return blobs(12, sh_degree=2)


def unpacked_sog() -> dict[str, bytes]:
    with zipfile.ZipFile(SPLAT_TRANSFORM / "model.sog") as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def files() -> dict[str, bytes]:
    """Return the content of a model's files in every format and version, by path."""
    stored = [*SPLAT_TRANSFORM.iterdir(), *OLDER_FORMATS.iterdir()]
    unpacked = {f"unpacked/{name}": data for name, data in unpacked_sog().items()}
    return {path.name: path.read_bytes() for path in stored} | unpacked


def write_all(folder: Path) -> dict[str, Path]:
    """Write a model in every format and version; return the paths of all but images."""
    for name, data in files().items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(data)
    return {name: folder / name for name in files() if not name.endswith(".webp")}
