"""Where a file comes from: a record beside it."""

from collections.abc import Iterable, Mapping
from itertools import chain
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.artifacts.checksums import file_checksum, file_digest, forget, record_file, record_of, with_checksum
from gspure.artifacts.files import write_json
from gspure.errors import InputError, reading

UNMOVED: Final = np.eye(4)  # the motion of a model that no attack moved


def write_record(
    path: Path,
    *,
    inputs: Mapping[str, Path],
    settings: Mapping[str, Any],
    geometry: str = "",
    kind: str = "",
    embedding: str = "",
    motion: NDArray[np.float64] | None = None,
    ancestors: Mapping[str, str] | None = None,
) -> None:
    """Write ``<path>.json`` beside an artifact: size, checksum, digest, digests of its inputs, settings and version.

    The digest of an input with a record is taken from there, as the input was verified when it was read. Inputs
    that are folders are left out.

    `geometry` is the digest of the model that it was made from (`gspure.schemes.registry.geometry_of`). If `inputs`
    has no model, it is that of all inputs, if they have the same. `kind` names what a file holds, where others have
    its type and shape. `ancestors` are digests of what else it was made from, by name. Further ones are the inputs of
    this geometry that have a kind, and the ancestors of these inputs, except those in which inputs differ: a table
    about several pairs has no single message. An input `table` is an ancestor, too. See also `measured_settings`.

    `embedding` is common to the public model, the files beside it and the key that one run of `gspure embed` writes:
    the digest of the public model (`embedding_of`). By default, it is that of the input `model`. `motion` is
    the rigid transform [4,4] by which attacks moved a model away from its cameras, the identity if none did, or that of
    the model that generated views look at (`motion_of`); None if it is unknown.
    """
    from gspure import __version__

    files = {name: Path(source) for name, source in inputs.items() if Path(source).is_file()}
    if "model" not in inputs and len(geometries := {*filter(None, map(_geometry_of, files.values()))}) == 1:
        geometry = geometries.pop()
    digests = {name: {"file": source.name, "digest": known_digest(source)} for name, source in files.items()}
    record = {
        "artifact": path.name,
        "bytes": path.stat().st_size,
        "crc32": file_checksum(path),
        "digest": file_digest(path),
        "gspure": __version__,
        "inputs": digests,
        "settings": dict(settings),
    }
    table = {"table": digests["table"]["digest"]} if "table" in digests else {}
    ancestors = _agreed(_ancestors(source, geometry) for source in files.values()) | table | dict(ancestors or {})
    if "model" in files:
        embedding = embedding or embedding_of(files["model"])
    moved = None if motion is None else motion.tolist()
    measurements = filter(_geometry_of, files.values())
    measured = _agreed({**measured_settings(source), **settings_of(source)} for source in measurements)
    known = {"geometry": geometry, "kind": kind, "ancestors": ancestors, "embedding": embedding, "motion": moved}
    known |= {"measured": measured}
    record |= {name: value for name, value in known.items() if value}
    try:
        write_json(record_file(path), with_checksum(record))
    except OSError:  # an artifact without its record would be half a result
        path.unlink(missing_ok=True)
        forget(path)
        raise


def facts_of(artifact: Path) -> dict[str, str]:
    """Return what the record of a file says about its origin, by name; nothing without a record.

    Of a folder, it is what the records of its files say, if all agree. `model` is the digest of the geometry. See
    `write_record` for `embedding` and the ancestors.
    """
    return _agreed(
        {"embedding": _embedding_of(file), "model": (geometry := _geometry_of(file)), **_ancestors(file, geometry)}
        for file in _files_of(artifact)
    )


def embedding_of(artifact: Path) -> str:
    """Return the embedding that the record of a file, or those of the files of a folder, name; empty if none does.

    Raise `InputError` naming the first file of another embedding.
    """
    known = {file: {"embedding": name} for file in _files_of(artifact) if (name := _embedding_of(file))}
    first = next(iter(known), artifact)
    for file, embedding in known.items():
        require_agreement(first, file, known[first], embedding, "of another run of `gspure embed`")
    return known[first]["embedding"] if known else ""


def require_embedding(
    embedding: str, *artifacts: Path, hint: str = "copy files of `gspure embed` with their .json"
) -> None:
    """Raise `InputError` for an artifact, or a file of a folder, whose record names another embedding or that has none.

    If `embedding` is empty, all pass.
    """
    for file in chain.from_iterable(map(_files_of, artifacts)) if embedding else ():
        if (name := _embedding_of(file)) != embedding:
            raise InputError(file, "embedding", expected=embedding, found=name or "no record", hint=hint)


def _embedding_of(file: Path) -> str:
    return str((record_of(file) or {}).get("embedding") or "")


def _files_of(artifact: Path) -> list[Path]:
    """Return the files of a folder that may have a record; a file stands for itself."""
    if not artifact.is_dir():
        return [artifact]
    return [file for file in sorted(artifact.glob("[!.]*")) if file.suffix != ".json"]


def motion_of(artifact: Path) -> NDArray[np.float64] | None:
    """Return the rigid transform [4,4] by which attacks moved a model away from its cameras; None if it is unknown.

    That of generated views is the motion of the model that they look at.
    """
    if "motion" not in (record := record_of(artifact) or {}):
        return None
    with reading(record_file(artifact), "a rigid transform", "motion"):
        motion = np.array(record["motion"], np.float64).reshape(4, 4)
        if not np.isfinite(motion).all():
            raise ValueError("numbers that are not finite")
    return motion


def require_same_origin(artifact: Path, *others: Path) -> None:
    """Raise `InputError` if two artifacts differ in an input or setting that both have; without records, they pass."""
    origin = {**settings_of(artifact), **recorded_inputs(artifact)}
    for other in others:
        require_agreement(artifact, other, origin, {**settings_of(other), **recorded_inputs(other)})


def require_agreement(
    first: Path, second: Path, expected: Mapping[str, Any], found: Mapping[str, Any], hint: str = ""
) -> None:
    """Raise `InputError` if what two artifacts were made from differs for a name that both have."""
    for name, origin in expected.items():
        if origin != found.get(name, origin):
            hint = hint or f"not of the same {name}; if they belong together, delete the record (.json) of one"
            raise InputError(second, name, expected=f"{origin}, as in {first}", found=str(found[name]), hint=hint)


def require_kind(artifact: Path, *kinds: str) -> str:
    """Return what an array holds, of `kinds`; without a record, the first. Raise `InputError` if something else."""
    kind = (record_of(artifact) or {}).get("kind", kinds[0])
    if kind not in kinds:
        raise InputError(artifact, "content", expected=" or ".join(kinds), found=str(kind))
    return str(kind)


def settings_of(artifact: Path) -> dict[str, Any]:
    """Return the settings in the record of an artifact; none without a record."""
    match record_of(artifact):
        case {"settings": dict(settings)}:
            return settings
    return {}


def measured_settings(artifact: Path) -> dict[str, str]:
    """Return the settings, as text, of the arrays that an artifact was made from, as its record names them.

    A setting in which two arrays differ is left out.
    """
    match record_of(artifact):
        case {"measured": dict(settings)}:
            return {str(name): str(value) for name, value in settings.items()}
    return {}


def _geometry_of(artifact: Path) -> str:
    geometry = (record_of(artifact) or {}).get("geometry")
    return geometry if isinstance(geometry, str) else ""


def recorded_inputs(artifact: Path) -> dict[str, str]:
    """Return the digests of the direct inputs of an artifact, by name."""
    match record_of(artifact):
        case {"inputs": dict(inputs)}:
            return {name: str(known.get("digest")) for name, known in inputs.items() if isinstance(known, dict)}
    return {}


def _ancestors(artifact: Path, geometry: str) -> dict[str, str]:
    """Return the digests of an artifact of this geometry and of those that it was made from, by name."""
    if _geometry_of(artifact) != geometry:
        return {}
    record = record_of(artifact) or {}
    ancestors = record.get("ancestors")
    digests = dict(ancestors) if isinstance(ancestors, dict) else {}
    return digests | ({kind: record.get("digest")} if isinstance(kind := record.get("kind"), str) else {})


def _agreed(facts: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """Return the facts in which those that hold them agree."""
    known: dict[str, set[str]] = {}
    for name, origin in (item for each in facts for item in each.items() if item[1]):
        known.setdefault(name, set()).add(str(origin))
    return {name: origins.pop() for name, origins in known.items() if len(origins) == 1}


def known_digest(source: Path) -> str:
    """Return the digest of a file, from its record if it has one."""
    known = (record_of(source) or {}).get("digest")
    return known if isinstance(known, str) else file_digest(source)
