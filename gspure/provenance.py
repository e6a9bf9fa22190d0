"""The provenance of a folder of results: the command that wrote it, with its inputs and settings."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from gspure.errors import InputError
from gspure.files import digest_as_read, read_json, write_json

PROVENANCE: Final = "provenance.json"

_MEASURING: Final = {"purify", "decision", "evaluate"}  # commands that fill a folder with arrays of their model's rows


def write_provenance(
    folder: Path,
    command: str,
    *,
    inputs: Mapping[str, Path],
    settings: Mapping[str, Any],
    further: Sequence[Path] = (),
    run: str = "",
) -> None:
    """Write ``provenance.json`` to a folder of results: version, command, settings, inputs with their SHA-256.

    `further` are outputs beside the main one. `run` is the run ID of the embedding to which the results belong: the
    digest of its public model. By default it is that of the first input with one.
    """
    from gspure import __version__

    record: dict[str, Any] = {
        "gspure": __version__,
        "command": command,
        "settings": dict(settings),
        "inputs": {name: _input_record(path) for name, path in inputs.items()},
    }
    if further:
        record["outputs"] = [path.name for path in further]
    run = run or next(filter(None, map(run_of, inputs.values())), "")
    if run:
        record["run"] = run
    write_json(Path(folder) / PROVENANCE, record)


def _input_record(path: Path) -> dict[str, str]:
    record = {"path": str(path)}
    if Path(path).is_file():
        record["sha256"] = digest_as_read(path)
    return record


def require_rows_of(model: Path, array: Path) -> None:
    """Refuse an array of rows that was measured on another model, by the provenance beside it, if there is one.

    As many rows may be other ones: editors and trainers change their order.
    """
    file = array.parent / PROVENANCE
    record = read_json(file) if file.is_file() else {}
    match record:
        case {"command": str(command), "inputs": {"model": {"path": str(path), "sha256": str(measured)}}}:
            is_of_rows = command in _MEASURING or array.name in record.get("outputs", [])
        case _:
            return
    if is_of_rows and measured != digest_as_read(model):
        expected = f"an array of the rows of {model}"
        hint = "rows may be in another order: measure this model, as by `gspure purify`"
        raise InputError(array, "model", expected=expected, found=f"one of {path}, another model", hint=hint)


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
