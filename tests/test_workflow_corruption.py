"""Corrupt artifacts: a job that reads one names it, and the next run makes it again, to the same bytes."""

import contextlib
import json
import os
import shutil
from pathlib import Path

import pytest

from gspure.workflow.notes import NOTES, state_of
from tests.test_checksums import flipped
from tests.test_workflow import (  # noqa: F401
    BOT,
    OMEGA,
    TABLE,
    checkout,
    finished,
    planned,
    project,
    rules_run,
    started,
)

pytestmark = pytest.mark.workflow


def zeroed(path):
    path.write_bytes(path.read_bytes()[:-60] + bytes(60))


def rotted(project, artifact):  # noqa: F811
    """Corrupt an artifact as a failing disk does, which changes no time."""
    path = project.folder / artifact
    flipped(path)
    for note in (project.folder / NOTES).rglob("*.json"):
        content = json.loads(note.read_text())
        if str(artifact) in content["files"]:
            with contextlib.chdir(project.folder):
                content["files"][str(artifact)][0] = state_of(str(artifact))
            note.write_text(json.dumps(content))


@pytest.mark.parametrize(
    ("artifact", "reader", "target", "maker"),
    [
        (OMEGA, "build_features", BOT / "features.npy", "accumulate_weights"),
        (BOT / "gspure" / "prune_mask.npy", "tabulate_metrics", TABLE, "attack_model"),
        (BOT / "gspure/public/point_cloud.ply", "render_scene", BOT / "gspure/renders/scene", "attack_model"),
    ],
    ids=["weights", "kept rows", "model"],
)
def test_a_corrupt_artifact_is_named_and_made_again_by_the_next_run(project, artifact, reader, target, maker):  # noqa: F811
    good = (project.folder / artifact).read_bytes()
    rotted(project, artifact)
    printed = project.run(str(target), "--forcerun", reader, status=1)
    assert f"{artifact}: content: expected CRC-32" in printed
    assert rules_run(project.run(str(target)))[maker] == 1
    assert (project.folder / artifact).read_bytes() == good
    assert (project.folder / target).exists()


def test_a_changed_artifact_and_its_dependents_are_remade(project):  # noqa: F811
    model, metrics = BOT / "gspure" / "public" / "point_cloud.ply", BOT / "gspure" / "metrics.csv"
    good, before = (project.folder / model).read_bytes(), (project.folder / metrics).read_bytes()
    flipped(project.folder / model)
    printed = project.run(TABLE)
    assert f"gspure: to be recomputed: {model}: " in printed
    assert rules_run(printed)["attack_model"] == rules_run(printed)["compare_renders"] == 1
    assert (project.folder / model).read_bytes() == good
    assert (project.folder / metrics).read_bytes() == before


def exchanged(stage: Path) -> None:
    """Replace a stage by that of another view, with its record."""
    other = next(stage.parent.glob("view_6.*.npy"))
    for suffix in ("", ".json"):
        shutil.copy(f"{other}{suffix}", f"{stage}{suffix}")


@pytest.mark.parametrize(
    ("corrupted", "problem"), [(zeroed, "content: expected CRC-32"), (exchanged, "record: expected view_5.")]
)
def test_a_corrupt_stage_is_named_and_its_view_alone_computed_by_the_next_run(project, corrupted, problem):  # noqa: F811
    stage = next(project.folder.glob("stages/vanilla/bot/contributions/view_5.*.npy"))
    good, omega, before = stage.read_bytes(), project.omega(), project.stages()
    corrupted(stage)
    assert f"{stage.name}: {problem}" in project.run(OMEGA, "--forcerun", "accumulate_weights", status=1)
    project.run(OMEGA)
    written = {name for name, when in project.stages().items() if when != before[name]}
    assert {name.partition(".")[0] for name in written} == {"view_5"}
    assert stage.read_bytes() == good
    assert project.omega() == omega


def test_measuring_again_finds_a_corrupt_stage(project):  # noqa: F811
    stage = next(project.folder.glob("stages/vanilla/bot/contributions/view_5.*.npy"))
    good = stage.read_bytes()
    zeroed(stage)
    project.run(OMEGA, "--forcerun", "measure_contributions")
    assert stage.read_bytes() == good


def test_a_variant_whose_render_was_deleted_is_rendered_again(project):  # noqa: F811
    renders = project.folder / BOT / "gspure" / "renders" / "scene"
    min(renders.glob("*.png")).unlink()
    assert planned(project.run(TABLE, "--dry-run")).items() >= {"render_scene": 1, "compare_renders": 1}.items()


def test_artifacts_of_another_variant_are_made_again(project):  # noqa: F811
    costs = Path("results/benchmarks/vanilla/bot")
    table = (project.folder / TABLE).read_bytes()
    for name in ("prune_mask.npy", "metrics.csv", "renders/scene"):
        foreign, own = (project.folder / BOT / variant / name for variant in ("random_matched", "gspure"))
        if own.is_dir():
            shutil.rmtree(own)
            shutil.copytree(foreign, own)
        else:
            for suffix in ("", ".json"):
                shutil.copy(f"{foreign}{suffix}", f"{own}{suffix}")
        printed = project.run(TABLE)
        assert f"gspure: to be recomputed: {BOT / 'gspure' / name}: " in printed
        assert (project.folder / TABLE).read_bytes() == table
        assert "Nothing to be done" in project.run(TABLE)
    for suffix in ("", ".json"):
        name = f"attack.cost.json{suffix}"
        shutil.copy(project.folder / costs / "random_matched" / name, project.folder / costs / "gspure" / name)
    assert rules_run(project.run(TABLE))["attack_model"] == 1
    shutil.rmtree(project.folder / BOT / "gspure")
    shutil.copytree(project.folder / BOT / "random_matched", project.folder / BOT / "gspure")
    assert rules_run(project.run(TABLE))["attack_model"] == 1
    assert (project.folder / TABLE).read_bytes() == table


@pytest.mark.parametrize("corrupted", [Path.unlink, lambda path: path.write_bytes(b"x")], ids=["deleted", "cut"])
def test_a_missing_artifact_is_remade_with_its_dependents(project, corrupted):  # noqa: F811
    artifact = project.folder / BOT / "features.npy"
    good, when = artifact.read_bytes(), artifact.stat().st_mtime_ns
    corrupted(artifact)
    if artifact.exists():
        os.utime(artifact, ns=(when, when))
    printed = project.run(TABLE)
    assert f"{BOT / 'features.npy'}: " in printed
    assert rules_run(printed)["span_tree"] == rules_run(printed)["build_features"] == 1
    assert artifact.read_bytes() == good
    assert "Nothing to be done" in project.run(TABLE)
