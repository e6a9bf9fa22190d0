"""The provenance of a folder of results: the command that wrote it, with its inputs and settings."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final
from zipfile import ZipFile

from gspure.errors import InputError, reading
from gspure.files import digest_as_read, read_json, write_json
from gspure.progress import warn

PROVENANCE: Final = "provenance.json"

_BOUND: Final = b"\nrows of SHA-256 "
_DIGITS: Final = 64
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


def bind_rows(model: Path, *arrays: Path) -> None:
    """Append the digest of a model's file to files with arrays of its rows, .npy or .npz: copies of them keep it."""
    if not model.is_file():  # chunks
        return
    line = _BOUND + digest_as_read(model).encode()
    for file in arrays:
        if file.suffix == ".npz":
            with ZipFile(file, "a") as archive:
                archive.comment = line
        else:
            with file.open("ab") as stream:
                stream.write(line)


def require_rows_of(model: Path, array: Path) -> None:
    """Refuse an array of rows that was measured on another model; warn of one that does not name its model.

    As many rows may be other ones: editors and trainers change their order.
    """
    measured = _bound_to(array)
    file = array.parent / PROVENANCE
    record = read_json(file) if file.is_file() and not measured else {}
    match record:
        case {"command": str(command), "inputs": {"model": {"sha256": str(sha256)}}}:
            if command in _MEASURING or array.name in record.get("outputs", []):
                measured = sha256
    if not measured:
        warn(f"{array}: does not name its model, so the order of its rows is unchecked: it must be that of {model}")
    elif model.is_file() and measured != digest_as_read(model):
        expected = f"an array that was measured on {model}"
        hint = "rows may be in another order: measure this model again, for example by `gspure purify`"
        raise InputError(array, "model", expected=expected, found="one of another model", hint=hint)


def _bound_to(array: Path) -> str:
    """Return the digest that `bind_rows` appended to a file; empty without one."""
    with reading(array, "an array of rows"), array.open("rb") as stream:
        stream.seek(-min(array.stat().st_size, len(_BOUND) + _DIGITS), os.SEEK_END)
        return stream.read().partition(_BOUND)[2].decode("ascii", "replace")


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
