"""Results that are not those of the configuration: copied, replaced, or of an earlier one."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest

from gspure.cost import COSTS, cost_of
from gspure.model import write_model
from gspure.workflow.notes import NOTES, files_of, misfit
from tests.models import blobs
from tests.test_checksums import flipped
from tests.test_workflow import (  # noqa: F401
    AFTER_PRUNING,
    BOT,
    CONFIG,
    TABLE,
    checkout,
    edit_cameras,
    finished,
    project,
    reported,
    rules_run,
    started,
)

pytestmark = pytest.mark.workflow

WITHOUT_NOTE = {"logs", "benchmarks", "jobs"}
"""Folders of what is written about jobs. The cost of an attack, in `benchmarks`, is in the job's note nevertheless."""


def noted():
    """Return the notes of a project, the current folder: settings and paths by log."""
    notes = {}
    for file in NOTES.rglob("*.json"):
        note = json.loads(file.read_text())
        notes[f"results/logs/{file.relative_to(NOTES).with_suffix('.log')}"] = (note["settings"], [*note["files"]])
    return notes


def misfits():
    return {log for log, (settings, paths) in noted().items() if misfit(log, settings, paths)}


def replaced(path, source):
    """Replace an artifact, a file with its record or a folder; without a source, change one byte."""
    shutil.move(path, f"{path}.kept")
    if Path(f"{path}.json").exists():
        shutil.move(f"{path}.json", f"{path}.kept.json")
    if source and Path(source).is_dir():
        shutil.copytree(source, path)
    elif source:
        shutil.copy2(source, path)
        shutil.copy2(f"{source}.json", f"{path}.json")
    else:
        shutil.copytree(f"{path}.kept", path) if Path(f"{path}.kept").is_dir() else shutil.copy2(f"{path}.kept", path)
        flipped(next(file for file in Path(path).rglob("[!.]*")) if Path(path).is_dir() else Path(path))


def restored(path):
    shutil.rmtree(path) if Path(path).is_dir() else Path(path).unlink()
    for suffix in ("", ".json"):
        if Path(f"{path}.kept{suffix}").exists():
            shutil.move(f"{path}.kept{suffix}", f"{path}{suffix}")


def another(path):
    """Return the artifact of the same name of another variant; None if there is none."""
    places = [place for place in Path(path).parents if place.name in {"gspure", "random_matched", "clean"}]
    for place in places[:1]:
        for name in ("gspure", "random_matched", "unattacked", "clean"):
            other = place.with_name(name) / Path(path).relative_to(place)
            if name != place.name and other.exists() and (other.is_dir() or Path(f"{other}.json").exists()):
                return str(other)
    return None


def test_every_artifact_is_in_the_note_of_the_job_that_made_it(tmp_path, reported, monkeypatch):  # noqa: F811
    monkeypatch.chdir(reported.copy(tmp_path / "project").folder)
    known = {file.resolve() for _, paths in noted().values() for path in paths for file in files_of(path).values()}
    every = {file for file in Path("results").rglob("*") if file.is_file() and not WITHOUT_NOTE & {*file.parts}}
    every |= {cost_of(file) for file in Path(COSTS).rglob("attack.tsv")}
    assert {file for file in every if file.resolve() not in known and not file.name.startswith(".")} == set()


def test_jobs_fit_the_files_of_their_notes_alone(tmp_path, reported, monkeypatch):  # noqa: F811
    monkeypatch.chdir(reported.copy(tmp_path / "project").folder)
    notes = noted()
    assert misfits() == set()
    for path in sorted({path for _, paths in notes.values() for path in paths if Path(path).exists()}):
        concerned = {log for log, (_, paths) in notes.items() if path in paths}
        for source, when in ((None, 10**9), (another(path), 2 * 10**18)):
            replaced(path, source)
            os.utime(path, ns=(when, when))
            assert misfits() == concerned, (path, source)
            restored(path)
    assert misfits() == set()


def test_copied_results_fit_without_the_notes_of_snakemake(project):  # noqa: F811
    shutil.rmtree(project.folder / ".snakemake")
    assert "Nothing to be done" in project.run(TABLE)
    project.configure({**CONFIG, "method": {**CONFIG["method"], "tau_n": 1.0}})
    before = (project.folder / BOT / "prune_mask.npy").read_bytes()
    assert rules_run(project.run(TABLE)) == AFTER_PRUNING
    assert (project.folder / BOT / "prune_mask.npy").read_bytes() != before


def test_results_without_notes_are_refused(project):  # noqa: F811
    shutil.rmtree(project.folder / NOTES)
    before = (project.folder / TABLE).read_bytes()
    assert f"expected the notes of a run in {NOTES}" in project.run(TABLE, status=2)
    assert (project.folder / TABLE).read_bytes() == before
    assert "Nothing to be done" not in project.run(TABLE, "--forceall", "--dry-run")
    project.run(TABLE, "--touch")
    assert "Nothing to be done" in project.run(TABLE)


def test_a_scene_whose_folder_was_replaced_by_another_is_made_again(tmp_path, project):  # noqa: F811
    """Every file is of another model, with its record; only the folder of the notes is the scene's."""
    assets = {**CONFIG["assets"], "other": {"model": "other.ply", "cameras": "views.json"}}
    write_model(project.folder / "other.ply", blobs(300, sh_degree=0, seed=1))
    project.configure({**CONFIG, "assets": assets})
    project.run(TABLE)
    expected = contents(project.folder / "results/vanilla")
    for name in ("bot", "logs/vanilla/bot"):
        folder = project.folder / ("results" if "/" in name else "results/vanilla") / name
        shutil.rmtree(folder)
        shutil.copytree(folder.with_name("other"), folder)
    shutil.rmtree(project.folder / ".snakemake")
    printed = project.run(TABLE)
    assert rules_run(printed).total() >= 15
    assert contents(project.folder / "results/vanilla") == expected
    shutil.copytree(
        project.folder / NOTES / "vanilla/other", project.folder / NOTES / "vanilla/bot", dirs_exist_ok=True
    )
    project.run(TABLE)
    assert contents(project.folder / "results/vanilla") == expected


def test_models_that_change_their_names_change_their_results(tmp_path, project, started):  # noqa: F811
    """The results of a configuration that was changed in every way are bit for bit those of a fresh run."""
    changes = {
        "method": {**CONFIG["method"], "tau_c": 2.0},
        "variants": {**CONFIG["variants"], "random_matched": {"seed": 5}},
    }
    fresh = started.copy(tmp_path / "fresh")
    for each in (project, fresh):
        edit_cameras(each, lambda cameras: cameras[3]["position"].__setitem__(0, 0.125))
        write_model(each.folder / "bot.ply", blobs(300, sh_degree=0, seed=2))
        os.utime(each.folder / "bot.ply", (1, 1))
        each.configure({**CONFIG, **changes})
        each.run(TABLE)
    assert contents(project.folder / "results/vanilla") == contents(fresh.folder / "results/vanilla")
    assert (project.folder / TABLE).read_bytes() == (fresh.folder / TABLE).read_bytes()


def contents(folder):
    """Return the content of all files but costs, which differ from run to run."""
    files = (file for file in sorted(folder.rglob("[!.]*")) if file.is_file())
    return {str(file.relative_to(folder)): file.read_bytes() for file in files if ".cost" not in file.name}
