"""The provenance of a folder of results: what made it, from what, with which settings."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from gspure.files import file_digest, read_json, write_json

PROVENANCE: Final = "provenance.json"


def write_provenance(
    folder: Path, command: str, *, inputs: Mapping[str, Path], settings: Mapping[str, Any], run: str = ""
) -> None:
    """Write ``provenance.json`` to a folder of results: version, command, settings, inputs with their SHA-256.

    `run` is the run ID of the embedding that the results belong to: the digest of its public model. By default it is
    that of the first input with one.
    """
    from gspure import __version__

    run = run or next(filter(None, map(run_of, inputs.values())), "")
    known = {
        name: {"path": str(path)} | ({"sha256": file_digest(path)} if Path(path).is_file() else {})
        for name, path in inputs.items()
    }
    record = {"gspure": __version__, "command": command, "settings": dict(settings), "inputs": known}
    write_json(Path(folder) / PROVENANCE, record | ({"run": run} if run else {}))


def run_of(path: Path) -> str:
    """Return the run ID in the provenance of a folder, or of the folder of a file; empty if it names none."""
    folder = Path(path) if Path(path).is_dir() else Path(path).parent
    if not (file := folder / PROVENANCE).is_file():
        return ""
    match read_json(file):
        case {"run": str(run)}:
            return run
    return ""
