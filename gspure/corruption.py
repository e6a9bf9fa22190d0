"""Corrupt artifacts of a workflow: found by their checksums, and set aside so that the next run makes them again."""

import shutil
from collections.abc import Iterable
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Final

from gspure.artifacts import record_of, verify
from gspure.artifacts.checksums import record_file, require_size
from gspure.errors import InputError
from gspure.evaluation.origins import Check, origin_checks
from gspure.images import RENDERED, require_all_images, require_intact
from gspure.method.contributions import is_index, read_index, read_stage

RESULTS: Final = Path("results")  # where the workflow keeps what it makes; files elsewhere are the user's


def problems_below(folders: Iterable[Path]) -> tuple[int, list[str]]:
    """Verify all files below some folders that have a checksum, all stages that an index there lists, and all renders.

    Return how many files were verified, and what is wrong with those that are corrupt or missing, one line each.
    """
    below = {path for folder in folders for path in folder.rglob("*")}
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


def unfit(further: Iterable[tuple[Path, Check]] = ()) -> dict[Path, str]:
    """Return the artifacts of a workflow that are missing, cut or of another variant, or lack an image, with a line.

    Only records are read. `further` checks are made, too.
    """
    checks: list[tuple[Path, Check]] = [(file, require_size) for file in _recorded(RESULTS.rglob("*.json"))]
    checks += [(record.parent, require_all_images) for record in RESULTS.rglob(RENDERED)]
    checks += chain(further, *map(origin_checks, RESULTS.glob("*/*/*/")))
    return {artifact: problem for artifact, check in checks if (problem := _problem(artifact, check))}


def set_aside(artifacts: Iterable[Path]) -> dict[Path, str]:
    """Rename corrupt artifacts of a workflow to ``NAME.corrupt``: as they are missing, the next run makes them again.

    An artifact is a file or a folder; an index is corrupt if a stage that it lists is. What is not below `RESULTS` is
    left alone.

    Return what is wrong with each corrupt artifact, in one line.
    """
    checked = {artifact: _problem_of(artifact) for artifact in artifacts if RESULTS in artifact.parents}
    corrupt = {artifact: problem for artifact, problem in checked.items() if problem}
    for artifact in corrupt:
        _rename(artifact)
    return corrupt


def discard(artifacts: Iterable[Path]) -> None:
    """Delete artifacts of a workflow, files or folders, with their checksums."""
    for artifact in artifacts:
        if RESULTS not in artifact.parents:
            continue
        if artifact.is_dir():
            shutil.rmtree(artifact)
        else:
            artifact.unlink(missing_ok=True)
            record_file(artifact).unlink(missing_ok=True)


def _problem_of(artifact: Path) -> str:
    files = sorted(artifact.rglob("*")) if artifact.is_dir() else [artifact]
    problems = [problem for file in files if (problem := _problem(file))]
    if not problems and is_index(artifact):
        problems = [problem for stage in read_index(artifact) if (problem := _problem(stage.path, read_stage))]
    return problems[0] if problems else ""


def _problem(file: Path, check: Check | None = None) -> str:
    """Return what is wrong with a file by a check, the whole one by default."""
    try:
        (check or _check)(file)
    except InputError as error:
        return str(error)
    return ""


def _check(file: Path) -> None:
    require_size(file)
    read_index(file) if is_index(file) else verify(file)


def _recorded(paths: Iterable[Path]) -> set[Path]:
    """Return the files that have a record among `paths`, missing ones too."""
    return {file for path in paths if path.suffix == ".json" and _has_record(file := path.with_suffix(""))}


def _has_record(file: Path) -> bool:
    try:
        return record_of(file) is not None
    except InputError:
        return bool(file.suffix)  # else it is a corrupt JSON file of its own


def _rename(artifact: Path) -> None:
    if artifact.is_file():
        record_file(artifact).unlink(missing_ok=True)
    aside = artifact.with_name(f"{artifact.name}.corrupt")
    if aside.is_dir():
        shutil.rmtree(aside)
    with suppress(FileNotFoundError):  # it was missing, or another job was quicker
        artifact.rename(aside)
