"""Corrupt artifacts of a workflow, found by their checksums."""

from collections.abc import Callable, Iterable
from pathlib import Path

from gspure.artifacts import RENDERED, record_of, verify
from gspure.artifacts.checksums import record_file, require_size
from gspure.errors import InputError
from gspure.images import require_all_images, require_intact
from gspure.method.contributions import is_index, is_stage, read_index, read_stage


def problems_in(artifacts: Iterable[Path]) -> tuple[int, list[str]]:
    """Verify all files with a checksum among some files and below folders, with all stages of indices, and all renders.

    Return how many files were verified, and what is wrong with those that are corrupt or missing, one line each.
    """
    below = {path for artifact in artifacts for path in (artifact, record_file(artifact), *artifact.rglob("*"))}
    files = _recorded(below)
    indices = {file for file in below if is_index(file)}
    stages: set[Path] = set()
    problems = []
    for index in sorted(indices):
        if problem := _problem(index):
            problems.append(problem)
        else:
            stages |= {stage.path.resolve() for stage in read_index(index)}
    rendered = {record.parent for record in below if record.name == RENDERED}
    images = {image for folder in rendered for image in folder.glob("*.png")}
    others = {file for file in files - indices if file.resolve() not in stages}
    problems += filter(None, [_problem(file) for file in sorted(others)])
    problems += filter(None, [_problem(stage, read_stage) for stage in sorted(stages)])
    problems += filter(None, [_problem(folder, require_all_images) for folder in sorted(rendered)])
    problems += filter(None, [_problem(image, require_intact) for image in sorted(images)])
    return len(indices) + len(others) + len(stages) + len(images), problems


def _problem(file: Path, check: Callable[[Path], object] | None = None) -> str:
    """Return what is wrong with a file by a check, the whole one by default."""
    try:
        (check or _check)(file)
    except InputError as error:
        return str(error)
    return ""


def _check(file: Path) -> None:
    require_size(file)
    if is_index(file):
        read_index(file)
    elif is_stage(file):
        read_stage(file)
    else:
        verify(file)


def _recorded(paths: Iterable[Path]) -> set[Path]:
    """Return the files that have a record among `paths`, missing ones too."""
    return {file for path in paths if path.suffix == ".json" and _has_record(file := path.with_suffix(""))}


def _has_record(file: Path) -> bool:
    try:
        return record_of(file) is not None
    except InputError:
        return bool(file.suffix)  # else it is a corrupt JSON file of its own
