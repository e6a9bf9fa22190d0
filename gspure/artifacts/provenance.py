"""Where a file comes from: a record beside it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gspure.artifacts.checksums import file_checksum, file_digest, record_file, record_of
from gspure.artifacts.files import write_json
from gspure.errors import InputError


def write_provenance(path: Path, *, inputs: Mapping[str, Path], settings: Mapping[str, Any]) -> None:
    """Write ``<path>.json`` beside an artifact: size, checksum, digest, digests of its inputs, settings and version.

    The digest of an input that has provenance is taken from there, as the input was verified when it was read. Inputs
    that are folders are left out.
    """
    from gspure import __version__

    files = {name: Path(source) for name, source in inputs.items() if Path(source).is_file()}
    record = {
        "artifact": path.name,
        "bytes": path.stat().st_size,
        "crc32": file_checksum(path),
        "digest": file_digest(path),
        "gspure": __version__,
        "inputs": {name: {"file": source.name, "digest": _known_digest(source)} for name, source in files.items()},
        "settings": dict(settings),
    }
    write_json(record_file(path), record)


def require_made_from(model: Path, *artifacts: Path) -> None:
    """Check artifacts whose records name the model that they were made from; others pass.

    Raises
    ------
    InputError
        Naming the first that was made from another model.

    """
    for artifact in artifacts if model.is_file() else ():
        match record_of(artifact):
            case {"inputs": {"model": {"digest": str(expected)}}} if expected != _known_digest(model):
                hint = f"if it fits this model too, delete {record_file(artifact).name}"
                raise InputError(artifact, "model", expected=str(model), found="made from another model", hint=hint)


def _known_digest(source: Path) -> str:
    known = (record_of(source) or {}).get("digest")
    return known if isinstance(known, str) else file_digest(source)
