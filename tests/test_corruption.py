"""Corrupt artifacts of a workflow, listed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gspure.artifacts import digest, save_array, write_json, write_record
from gspure.cli import main
from gspure.corruption import problems_in
from gspure.images import record_views, write_image
from gspure.method.contributions import Measurement, Stage, write_index
from gspure.renderer import CONTRIBUTION
from tests.test_checksums import flipped

SCENE = Path("results/vanilla/room")
OMEGA = SCENE / "weights.npy"
INDEX = SCENE / "contributions" / "1-of-1.tsv"
STAGES = Path("stages/vanilla/room/contributions")
CAMERAS = Path("results/pairs/room/cameras.json")


def noted(path: Path) -> Path:
    write_record(path, inputs={}, settings={})
    return path


@pytest.fixture(autouse=True)
def project(tmp_path, monkeypatch):
    """A project in which weights have been measured; it is the current folder."""
    monkeypatch.chdir(tmp_path)
    stages = [Stage(view, "key", STAGES / f"{view}.key.npy") for view in ("a", "b", "c")]
    for stage in stages:
        save_array(stage.path, np.array([(0, 1.5, 0.5, 4), (3, 0.25, 0.25, 1)], CONTRIBUTION))
        noted(stage.path)
    write_index(INDEX, stages, Measurement("model", "settings", "device", len(stages)))
    noted(INDEX)
    save_array(OMEGA, np.ones(20, np.float32))
    noted(OMEGA)
    write_json(CAMERAS, [{"id": 0}])
    noted(CAMERAS)
    benchmark = Path("results/benchmarks/vanilla/room/contributions/1-of-1.tsv")
    benchmark.parent.mkdir(parents=True)
    benchmark.write_text("s\th:m:s\n1.0\t0:00:01\n")
    return tmp_path


def verify(capsys, *folder: str) -> tuple[int, list[str]]:
    status = main(["stages", "--verify", *folder])
    return status, capsys.readouterr().out.splitlines()


def test_an_intact_project_is_verified(capsys):
    assert verify(capsys) == (0, ["6 files verified, 0 corrupt"])
    assert verify(capsys, "stages") == (0, ["3 files verified, 0 corrupt"])
    assert verify(capsys, "results") == (0, ["6 files verified, 0 corrupt"])  # with the stages that the index lists


def test_every_corrupt_file_is_listed_and_none_is_touched(project, capsys):
    flipped(OMEGA)
    flipped(CAMERAS)
    flipped(STAGES / "a.key.npy")
    (STAGES / "b.key.npy").unlink()
    before = {path: path.read_bytes() for path in project.rglob("*") if path.is_file()}
    status, lines = verify(capsys)
    assert status == 1
    assert len(lines) == 5
    assert lines[-1] == "6 files verified, 4 corrupt"
    for file, found in ((OMEGA, "CRC-32"), (CAMERAS, "CRC-32"), ("a.key.npy", "CRC-32"), ("b.key.npy", "no such file")):
        assert any(f"{file}: " in line and found in line for line in lines)
    assert {path: path.read_bytes() for path in project.rglob("*") if path.is_file()} == before


def test_an_index_with_a_line_less_and_corrupt_provenance_are_listed(capsys):
    INDEX.write_text("".join(INDEX.read_text().splitlines(keepends=True)[:-1]))
    Path(f"{OMEGA}.json").write_text("{")
    status, lines = verify(capsys, "results")
    assert status == 1
    assert [line.split(": ")[0] for line in lines[:-1]] == [str(INDEX), f"{OMEGA}.json"]


def test_deleted_artifacts_are_listed_by_their_records(capsys):
    OMEGA.unlink()
    INDEX.unlink()
    CAMERAS.write_bytes(b"[")
    status, lines = verify(capsys, "results")
    assert status == 1
    assert [line.split(": ")[0] for line in lines[:-1]] == sorted(map(str, (CAMERAS, INDEX, OMEGA)))


def test_renders_that_are_corrupt_or_missing_are_listed(capsys):
    renders = [SCENE / "renders" / f"{view}.png" for view in ("a", "b")]
    for render in renders:
        write_image(render, np.full((4, 4, 3), 0.5))
    record_views(SCENE / "renders", {"a": [1.5], "b": []})
    assert verify(capsys) == (0, ["8 files verified, 0 corrupt"])
    flipped(renders[0], -20)
    renders[1].unlink()
    status, lines = verify(capsys)
    assert status == 1
    assert [line.split(": ")[0] for line in lines[:-1]] == [str(SCENE / "renders"), str(renders[0])]
    record = (SCENE / "renders" / "rendered.json").read_text()
    twice = record.replace("{", '{"background": "1 1 1", ', 1)
    for damaged in ('{"views', record.replace("1.5", "1.6"), '["a", "b"]', "{}", twice):
        (SCENE / "renders" / "rendered.json").write_text(damaged)
        assert any(line.startswith(f"{SCENE}/renders/rendered.json: record: ") for line in verify(capsys)[1])


def test_a_missing_folder_cannot_be_verified(capsys):
    assert main(["stages", "--verify", "absent"]) == 2
    assert "absent: folder: expected" in capsys.readouterr().err


def test_stages_are_pruned_by_the_indices_alone(capsys):
    old = STAGES / f"a.{digest('old')}.npy"
    save_array(old, np.zeros(0, CONTRIBUTION))
    noted(old)
    assert main(["stages", "prune"]) == 0
    assert capsys.readouterr().out.startswith("1 stages deleted, ")
    assert sorted(path.name for path in STAGES.glob("*.npy")) == ["a.key.npy", "b.key.npy", "c.key.npy"]


def test_stages_of_another_project_are_not_pruned(tmp_path, capsys):
    stage = tmp_path / "other" / f"a.{digest('other')}.npy"
    save_array(stage, np.zeros(0, CONTRIBUTION), checksum=True)
    assert main(["stages", "prune", "--stages", str(tmp_path / "other")]) == 2
    assert "other: stages: expected some that" in capsys.readouterr().err
    assert stage.exists()


def test_an_artifact_is_corrupt_by_its_own_content():
    assert problems_in([OMEGA]) == (1, [])
    flipped(OMEGA)
    (problem,) = problems_in([OMEGA])[1]
    assert problem.startswith(f"{OMEGA}: content: expected CRC-32")


@pytest.mark.parametrize("corrupted", [flipped, Path.unlink], ids=["flipped", "removed"])
def test_an_index_is_corrupt_when_one_of_its_stages_is(corrupted):
    assert problems_in([INDEX]) == (4, [])
    corrupted(STAGES / "b.key.npy")
    (problem,) = problems_in([INDEX])[1]
    assert "b.key.npy: " in problem


def test_a_folder_is_corrupt_when_one_of_its_files_is():
    rows = SCENE / "key" / "message_rows.npy"
    save_array(rows, np.ones(3, bool))
    noted(rows)
    assert problems_in([rows.parent]) == (1, [])
    flipped(rows)
    (problem,) = problems_in([rows.parent])[1]
    assert "key/message_rows.npy: content" in problem


def test_a_folder_is_corrupt_when_one_of_its_images_is():
    renders = SCENE / "renders"
    write_image(renders / "a.png", np.full((4, 4, 3), 0.5))
    record_views(renders, {"a": []})
    assert problems_in([renders]) == (1, [])
    flipped(renders / "a.png", -20)
    assert problems_in([renders])[1]
