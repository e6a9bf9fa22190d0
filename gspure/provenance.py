"""The provenance of a folder of results: the command that wrote it, with its inputs and settings."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from gspure.files import digest_as_read, read_json, write_json

PROVENANCE: Final = "provenance.json"


def write_provenance(
    folder: Path, command: str, *, inputs: Mapping[str, Path], settings: Mapping[str, Any], run: str = ""
) -> None:
    """Write ``provenance.json`` to a folder of results: version, command, settings, inputs with their SHA-256.

    `run` is the run ID of the embedding to which the results belong: the digest of its public model. By default it is
    that of the first input with one.
    """
    from gspure import __version__

    record: dict[str, Any] = {
        "gspure": __version__,
        "command": command,
        "settings": dict(settings),
        "inputs": {name: _input_record(path) for name, path in inputs.items()},
    }
    run = run or next(filter(None, map(run_of, inputs.values())), "")
    if run:
        record["run"] = run
    write_json(Path(folder) / PROVENANCE, record)


def _input_record(path: Path) -> dict[str, str]:
    record = {"path": str(path)}
    if Path(path).is_file():
        record["sha256"] = digest_as_read(path)
    return record


def run_of(path: Path) -> str:
    """Return the run ID in the provenance of a folder, or of the folder of a file; empty if it names none."""
    folder = Path(path) if Path(path).is_dir() else Path(path).parent
    file = folder / PROVENANCE
    if not file.is_file():
        return ""
    match read_json(file):
        case {"run": str(run)}:
            return run
    return ""
