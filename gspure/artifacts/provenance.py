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
    that are folders are left out. If `inputs` has no model, the one model that the inputs were made from is added.
    """
    from gspure import __version__

    files = {name: Path(source) for name, source in inputs.items() if Path(source).is_file()}
    models = {model["digest"]: model for source in files.values() if (model := _model_of(source))}
    inherited = {"model": next(iter(models.values()))} if len(models) == 1 else {}
    direct = {name: {"file": source.name, "digest": _known_digest(source)} for name, source in files.items()}
    record = {
        "artifact": path.name,
        "bytes": path.stat().st_size,
        "crc32": file_checksum(path),
        "digest": file_digest(path),
        "gspure": __version__,
        "inputs": inherited | direct,
        "settings": dict(settings),
    }
    write_json(record_file(path), record)


def require_made_from(model: Path | None, *artifacts: Path) -> None:
    """Check artifacts whose records name the model that they were made from; others pass.

    Without a model file, they should be of one model.

    Raises
    ------
    InputError
        Naming the first that was made from another model.

    """
    digest, expected = (_known_digest(model), str(model)) if model and model.is_file() else ("", "")
    for artifact in artifacts:
        if origin := _model_of(artifact):
            digest, expected = digest or origin["digest"], expected or f"the model of {artifact}"
            if origin["digest"] != digest:
                hint = f"if it fits this model too, delete {record_file(artifact).name}"
                raise InputError(artifact, "model", expected=expected, found="made from another model", hint=hint)


def _model_of(artifact: Path) -> dict[str, str] | None:
    match record_of(artifact):
        case {"inputs": {"model": {"file": str(file), "digest": str(digest)}}}:
            return {"file": file, "digest": digest}
    return None


def _known_digest(source: Path) -> str:
    known = (record_of(source) or {}).get("digest")
    return known if isinstance(known, str) else file_digest(source)
