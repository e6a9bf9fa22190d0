"""Where a file comes from: a record beside it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gspure.artifacts.checksums import file_checksum, file_digest, record_file, record_of
from gspure.artifacts.files import write_record
from gspure.errors import InputError


def write_provenance(
    path: Path, *, inputs: Mapping[str, Path], settings: Mapping[str, Any], geometry: str = "", kind: str = ""
) -> None:
    """Write ``<path>.json`` beside an artifact: size, checksum, digest, digests of its inputs, settings and version.

    The digest of an input that has provenance is taken from there, as the input was verified when it was read. Inputs
    that are folders are left out.

    `geometry` is the digest of the model that it was made from (`gspure.model.Gaussians.geometry_digest`). If `inputs`
    has no model, it is that of all inputs, if they have the same. `kind` names what an array holds, where others have
    its type and shape.
    """
    from gspure import __version__

    files = {name: Path(source) for name, source in inputs.items() if Path(source).is_file()}
    if "model" not in inputs and len(geometries := {*filter(None, map(_geometry_of, files.values()))}) == 1:
        geometry = geometries.pop()
    digests = {name: {"file": source.name, "digest": _known_digest(source)} for name, source in files.items()}
    record = {
        "artifact": path.name,
        "bytes": path.stat().st_size,
        "crc32": file_checksum(path),
        "digest": file_digest(path),
        "gspure": __version__,
        "inputs": digests,
        "settings": dict(settings),
    }
    write_record(path, record | {name: text for name, text in (("geometry", geometry), ("kind", kind)) if text})


def require_made_from(geometry: str, *artifacts: Path) -> None:
    """Check artifacts whose records name the geometry that they were made from; others pass.

    If `geometry`, the digest of a model (`gspure.model.Gaussians.geometry_digest`), is empty, all should be of one
    model. Raise `InputError` naming the first that was made from another.
    """
    for artifact in artifacts:
        origin = _geometry_of(artifact)
        geometry = geometry or origin
        if origin not in {"", geometry}:
            hint = f"made from another model; if it fits this one too, delete {record_file(artifact).name}"
            raise InputError(artifact, "model", expected=f"geometry {geometry}", found=origin, hint=hint)


def require_kind(artifact: Path, *kinds: str) -> None:
    """Raise `InputError` if an array holds something else than one of `kinds`; without a record, pass."""
    kind = (record_of(artifact) or {}).get("kind", "")
    if kind not in {"", *kinds}:
        raise InputError(artifact, "content", expected=" or ".join(kinds), found=str(kind))


def require_input(artifact: Path, name: str, source: Path) -> None:
    """Raise `InputError` if an artifact was made from another file than `source`; without a record, pass."""
    inputs = (record_of(artifact) or {}).get("inputs")
    known = inputs.get(name) if isinstance(inputs, dict) else None
    if isinstance(known, dict) and known.get("digest") != (digest := _known_digest(source)):
        raise InputError(artifact, name, expected=f"{source}, digest {digest}", found=f"digest {known.get('digest')}")


def _geometry_of(artifact: Path) -> str:
    geometry = (record_of(artifact) or {}).get("geometry")
    return geometry if isinstance(geometry, str) else ""


def _known_digest(source: Path) -> str:
    known = (record_of(source) or {}).get("digest")
    return known if isinstance(known, str) else file_digest(source)
