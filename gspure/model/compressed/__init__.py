"""Models in the compressed formats of converters and viewers: five are read, two of them also written."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

from gspure.artifacts import verify
from gspure.errors import InputError
from gspure.model.compressed.ksplat import read_ksplat
from gspure.model.compressed.sog import INDEX, read_sog
from gspure.model.compressed.splat import read_splat
from gspure.model.compressed.spz import read_spz
from gspure.model.gaussians import Gaussians

READERS: Final[dict[str, Callable[[Path], Gaussians]]] = {
    ".ksplat": read_ksplat,
    ".sog": read_sog,
    ".splat": read_splat,
    ".spz": read_spz,
    INDEX: read_sog,
}
"""By suffix, or by name. A compressed ``.ply`` is recognized by its header: see `gspure.model.ply`."""

STREAMED: Final = "lod-meta.json"  # the index of a streamed model: several levels of detail, each of which is a model


def is_compressed(path: Path) -> bool:
    """Return whether this is the name of a model in one of these formats, or of a streamed model."""
    return bool({path.name, path.suffix.lower()} & {STREAMED, *READERS})


def read_compressed(path: Path) -> Gaussians:
    """Read a model whose name `is_compressed`; raise `InputError` if it is corrupt or streamed."""
    if path.name == STREAMED:
        hint = "name the meta.json of one level of detail"
        raise InputError(path, "format", expected="a model", found="several, a streamed SOG model", hint=hint)
    verify(path)
    return READERS[INDEX if path.name == INDEX else path.suffix.lower()](path)
