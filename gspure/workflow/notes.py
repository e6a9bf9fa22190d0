"""Notes of finished jobs: what each was made from and what it made, so that the workflow knows whether results fit.

The note of the job with the log ``results/logs/JOB.log`` is ``results/jobs/JOB.json``. It holds a digest of the job's
settings, and a digest of the content of every file and folder that it reads or writes. Results fit the configuration if
their job has the settings of the note, and all files its content, wherever they came from and however old they are.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Final

from gspure.artifacts import digest, read_json, write_json
from gspure.artifacts.checksums import file_checksum, record_file
from gspure.errors import InputError
from gspure.model.compressed import is_compressed
from gspure.workflow.captures import model_files

RESULTS: Final = Path("results")
NOTES: Final = RESULTS / "jobs"


def note_of(log: str) -> Path:
    """Return where the note of the job with this log is."""
    return NOTES / Path(log).relative_to(RESULTS / "logs").with_suffix(".json")


def write_note(log: str, settings: str, paths: Iterable[str], before: Mapping[str, str]) -> None:
    """Write the note of a finished job; a file whose state is not that from `before` the job has no known content."""
    files = {}
    for path in paths:
        state = state_of(path)
        files[path] = [state, content_of(path, state) if before.get(path, state) in {"", state} else None]
    write_json(note_of(log), {"settings": settings, "files": files})


def misfit(log: str, settings: str, paths: Iterable[str]) -> str:
    """Return why the results of a job do not fit its settings, or these files its note; an empty text if they do."""
    note = note_of(log)
    with suppress(InputError):
        match read_json(note):
            case {"settings": str(former), "files": {**files}}:
                if former != settings:
                    return f"{note}: expected settings {settings}, found {former}"
                changed = (path for path in paths if not _is_known(path, files.get(path)))
                return next((f"{path}: expected the content recorded in {note}" for path in changed), "")
    return f"{note}: expected the note of a finished job"


def _is_known(path: str, known: object) -> bool:
    match known:
        case [str(state), str(content)]:
            return (now := state_of(path)) == state or content_of(path, now) == content
    return False


def state_of(path: str) -> str:
    """Return a digest of names, sizes and times of the files of an artifact; empty if it is missing.

    The times include that of the last change of a file's entry, which nobody can set back.
    """
    stats = [(name, file.stat()) for name, file in files_of(path).items()]
    return digest(repr([(name, s.st_size, s.st_mtime_ns, s.st_ctime_ns) for name, s in stats])) if stats else ""


@cache
def content_of(path: str, _state: str) -> str:
    """Return a digest of names and checksums of the files of an artifact in this state; empty if it is missing."""
    files = files_of(path)
    return digest(repr([(name, file_checksum(file)) for name, file in files.items()])) if files else ""


def files_of(path: str) -> dict[str, Path]:
    """Return the files of an artifact by relative path: those in a folder; or a file, its record and all beside it."""
    artifact = Path(path)
    files: Sequence[Path] = [artifact, record_file(artifact)]
    if artifact.is_dir():
        files = [file for file in sorted(artifact.rglob("*")) if not file.name.startswith(".")]
    elif artifact.suffix == ".png":  # a plot may be there in two formats
        files = [*files, drawing := artifact.with_suffix(".svg"), record_file(drawing)]
    elif artifact.suffix == ".ply" or is_compressed(artifact):
        files = [*files, *map(Path, model_files(path)[1:])]
    return {os.path.relpath(file, artifact): file for file in files if file.is_file()}
