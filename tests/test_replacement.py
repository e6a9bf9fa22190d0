"""Files of users: no command replaces one that it was not asked to write, or deletes one."""

import argparse
import json
import os
import re
import shlex
import shutil
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from gspure.artifacts import filling, remove, replacing, replacing_only, save_array, write_text
from gspure.cli import main
from gspure.cli.parser import Output
from gspure.datasets import archive_of
from gspure.errors import InputError
from gspure.evaluation.results import write_results
from gspure.images import record_views, write_image
from gspure.scenes.procedural import DECOYS
from tests.anchor_cases import random_public
from tests.contest_cases import benchmark
from tests.test_cli import parsers
from tests.test_datasets import zipped

MODEL = "marked/public/point_cloud.ply"
OF_MODEL = f"--model {MODEL} --cameras pair/cameras.json"
CASES = {  # each uses the files of those before it
    "pair": "pair room vault --views 4 --width 16 --height 16 --off-path 1 --out pair",
    "embed": "embed planted pair --set gaussians=300 --out marked",
    "cameras": "cameras pair --undistort --out flat/cameras.json",
    "render": f"render {MODEL} --cameras pair/cameras.json --npy --out planted/room/unattacked/renders/scene",
    "render orbit": f"render {MODEL} --cameras orbit --split test --out orbit",
    "extract": "extract marked/public --scheme planted --key marked/key --cameras pair/cameras.json "
    "--out planted/room/unattacked/renders/message",
    "purify": "purify marked/public --cameras pair/cameras.json --repair 2 --out purified",
    "attack": f"attack random_pruning {OF_MODEL} --out a/out.ply --scheme planted --removed a/removed.npy "
    "--verdict a/verdict.json --transform a/transform.npy --cost a/cost.json",
    "attack with networks": "attack random_pruning --model anchors/point_cloud.ply --out b/out.ply",
    "train": "train pair --iterations 2 --resolution native --out trained --model trained.ply",
    "metrics": "metrics pair planted/room/unattacked/renders --out planted/room/unattacked/metrics.csv",
    "detect": "detect planted/room/unattacked/renders/scene --command 'sh detector.sh' --out detected.csv",
    "contributions": f"contributions {OF_MODEL} --stages stages --index index.tsv",
    "weights": f"weights --index index.tsv --model {MODEL} --out weights.npy",
    "opacities": f"opacities {OF_MODEL} --out opacities.npy",
    "hidden": f"hidden {OF_MODEL} --scheme planted --key marked/key --weights weights.npy --out hidden.json "
    "--hidden hidden.npy",
    "surface": f"surface {OF_MODEL} --out surface.npy --mesh mesh.ply",
    "features": f"features --model {MODEL} --weights weights.npy --out features.npy",
    "tree": "tree --features features.npy --out tree.npy",
    "cluster": "cluster --tree tree.npy --out clusters.npz",
    "prune": "prune --clusters clusters.npz --weights weights.npy --out mask.npy --diagnosis diagnosis.json",
    "decoys": "decoys --views 1 --width 16 --height 16 --out decoys",
    "retrieve": "retrieve pair/message --extractions planted/room/unattacked/renders/message --out retrieval.csv",
    "table": "table --metrics planted/room/unattacked/metrics.csv --out t/results.csv --markdown t/results.md "
    "--summary t/summary.csv --latex t/summary.tex",
    "contest": "contest --table results.csv --out c/contest.csv --survival c/survival.csv --matched c/matched.csv "
    "--benchmarks benchmarks --costs c/costs.csv --markdown c/contest.md",
    "paper-check": "paper-check --out paper.csv",
    "figures model": f"figures model {OF_MODEL} --weights weights.npy --clusters clusters.npz --hidden hidden.npy "
    "--out figures",
    "figures outcomes": "figures outcomes --table results.csv --name sis/room --out f/outcomes.png",
    "figures panels": "figures panels --column a=pair/scene --column b=pair/message --out f/panels.png",
    "figures attacks": "figures attacks --table t/results.csv --name planted/room --column truth=pair "
    "--column unattacked=planted/room/unattacked/renders --out f/attacks.png",
    "figures sweep": "figures sweep --table results.csv --condition sis --point gspure=4,4 --point a=2,4 "
    "--out f/sweep.png",
    "figures tradeoff": "figures tradeoff --table results.csv --condition sis --out f/tradeoff.png",
    "report": "report --table results.csv --out report.html",
    "download": "download garden --out data --accept-licence",
}


def outputs(parser: argparse.ArgumentParser) -> list[str]:
    """Return the options that name what a command writes."""
    types = ((action, getattr(action.type, "args", (action.type,))[0]) for action in parser._actions)
    return [action.option_strings[0] for action, kind in types if isinstance(kind, type) and issubclass(kind, Output)]


def content(folder: Path = Path()) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def named(command: str) -> set[Path]:
    words = shlex.split(command)
    after = {option: Path(value) for option, value in pairwise(words)}
    (parser,) = (parser for name, parser in parsers().items() if f"{command} ".startswith(f"{name} "))
    return {after[option] for option in outputs(parser) if option in after}


@pytest.fixture(scope="module")
def project(tmp_path_factory) -> Iterator[dict[str, set[Path]]]:
    """The files that each command writes; the folder of all of them is the current one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("project"))
        Path("detector.sh").write_text(f"echo '{json.dumps({f'view_00{i}': 1.0 for i in range(4)})}'")
        archive = archive_of("garden")
        names = [f"{archive.folder}/garden/{name}".lstrip("/") for name in ("images_4/a.jpg", "sparse/0/cameras.bin")]
        zipped(Path("scenes.zip"), names)
        patch.setattr("gspure.scenes.procedural.DECOYS", DECOYS[:2])
        patch.setattr("gspure.cli.download.fetch", lambda *_: (Path("scenes.zip"), "digest"))
        random_public().write(Path("anchors/point_cloud.ply"))
        write_results(
            Path("results.csv"),
            benchmark({name: {"gspure": (1.0, 9.0), "a": (2.0, 1.0)} for name in ("room", "vault", "hall")}),
        )
        Path("benchmarks").mkdir()
        written = {}
        for case, command in CASES.items():
            before = content()
            assert main(shlex.split(command)) == 0, case
            written[case] = {*content()} - {*before}
            assert content().items() >= before.items()
        yield written


def test_every_output_of_every_command_is_among_the_cases():
    for command, parser in parsers().items():
        known = [case for case in CASES.values() if case.startswith(f"{command} ")]
        for option in outputs(parser):
            assert any(f" {option} " in case for case in known), f"{command} {option}"


@pytest.mark.parametrize("case", CASES)
def test_a_command_replaces_its_results_and_the_outputs_that_the_user_names_but_no_other_file(project, case, capsys):
    command = shlex.split(CASES[case])
    if case == "download":  # unpacks nothing where its record is
        Path("data/garden/origin.json").unlink()
    outputs_by_name = named(CASES[case])
    alike = {re.sub(r"[0-9a-f]{32}|\d+", "0", str(path)): path for path in sorted(project[case] - outputs_by_name)}
    whole = content()
    for file in {*alike.values()} - {Path("data/garden/origin.json")}:
        for path in (file, Path(f"{file}.json")):
            path.unlink(missing_ok=True)
        file.write_bytes(b"foreign")
        before = content()
        assert main(command) == 2, file
        assert capsys.readouterr().err.splitlines()[-1].startswith(f"gspure {command[0]}: ")
        assert content() == before, file
        for path in (file, Path(f"{file}.json")):
            if path in whole:
                path.write_bytes(whole[path])
    if case == "download":
        return
    for file in outputs_by_name:
        if file.is_file():
            file.write_bytes(b"foreign")
            Path(f"{file}.json").unlink(missing_ok=True)
    copies = backed_up(project[case])
    for _ in range(2):
        assert main(command) == 0, capsys.readouterr().err
    assert {path: path.read_bytes() for path in copies if path.exists()} == copies
    for folder in {path.parent for path in copies}:
        shutil.rmtree(folder)
    assert {*content()} == {*whole}


def backed_up(files: set[Path]) -> dict[Path, bytes]:
    """Copy results as users do, with their records, to folders beside them and beside their own."""
    copies = {}
    for path in sorted(filter(Path.exists, files)):
        for folder in (path.parent / "copy", path.parent.absolute().with_name(f"copy_of_{path.parent.name or 'all'}")):
            folder.mkdir(exist_ok=True)
            copies[folder / path.name] = Path(shutil.copy(path, folder)).read_bytes()
    return copies


def test_a_file_that_is_no_result_is_not_deleted(tmp_path):
    save_array(tmp_path / "weights.npy", np.zeros(3), checksum=True)
    save_array(tmp_path / "edited.npy", np.zeros(3), checksum=True)
    save_array(tmp_path / "mine.npy", np.zeros(3))
    (tmp_path / "edited.npy").write_bytes(b"edited")
    for suffix in ("npy", "npy.json"):
        shutil.copy(tmp_path / f"weights.{suffix}", tmp_path / f"backup.{suffix}")
    for name in "ab":
        write_image(tmp_path / f"{name}.png", np.zeros((4, 4, 3)))
    record_views(tmp_path, {"a": []})
    remove(*sorted(path for path in tmp_path.iterdir() if path.suffix != ".json"))
    kept = ["b.png", "backup.npy", "backup.npy.json", "edited.npy", "edited.npy.json", "mine.npy", "rendered.json"]
    assert sorted(path.name for path in tmp_path.iterdir()) == kept


def test_a_result_of_another_command_is_not_replaced_by_a_file_beside_the_named_one(tmp_path):
    with replacing_only("train", []):
        write_text(tmp_path / "cameras.json", "mine", checksum=True)
        write_text(tmp_path / "cameras.json", "again", checksum=True)
    with replacing_only("pair", []), pytest.raises(InputError, match=r"cameras\.json: output: .* run of `gspure pair`"):
        write_text(tmp_path / "cameras.json", "of the pair", checksum=True)
    assert (tmp_path / "cameras.json").read_text() == "again"
    with replacing_only("pair", [tmp_path / "cameras.json"]):
        write_text(tmp_path / "cameras.json", "named", checksum=True)
    assert (tmp_path / "cameras.json").read_text() == "named"


@pytest.mark.parametrize("link", ["symbolic", "hard", "dangling"])
def test_links_are_replaced_only_where_named_and_their_targets_stay(tmp_path, link):
    target, place = tmp_path / "mine.txt", tmp_path / "out" / "result.txt"
    place.parent.mkdir()
    target.write_text("mine")
    if link == "hard":
        os.link(target, place)
    else:
        place.symlink_to(target if link == "symbolic" else tmp_path / "nothing")
    with replacing_only("render", []), pytest.raises(InputError, match="expected a result of an earlier run"):
        write_text(place, "new")
    with replacing_only("render", [tmp_path / "out" / ".." / "out" / "result.txt"]):
        write_text(place, "new")
    assert (target.read_text(), place.read_text()) == ("mine", "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.txt", "out"]


def test_a_named_output_that_is_read_only_or_a_folder_is_refused(tmp_path):
    file, folder = tmp_path / "file", tmp_path / "folder"
    file.write_text("mine")
    file.chmod(0o444)
    folder.mkdir()
    for path, reason in ((file, "found a read-only one"), (folder, "found a folder")):
        with replacing_only("render", [path]), pytest.raises(InputError, match=reason), replacing(path):
            pytest.fail("it may not be written")
    assert file.read_text() == "mine"


def test_an_output_that_is_an_input_by_another_spelling_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("here").symlink_to(".")
    Path("link.ply").symlink_to("model.ply")
    shutil.copyfile(random_public().write(Path("anchors/point_cloud.ply"))[0], "model.ply")
    before = content()
    for spelling in ("here/model.ply", "anchors/../model.ply", str(tmp_path / "model.ply"), "link.ply"):
        assert main(["attack", "random_pruning", "--model", "model.ply", "--out", spelling]) == 2
        assert "expected a separate file" in capsys.readouterr().err
    assert content() == before


def test_a_link_to_itself_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("loop.ply").symlink_to("loop.ply")
    for words in (["info", "loop.ply"], ["attack", "random_pruning", "--model", "m.ply", "--out", "loop.ply"]):
        assert main(words) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_files_that_a_command_did_not_declare_are_a_programming_error(tmp_path):
    def write() -> None:
        with filling(tmp_path / "out", "a*") as folder:
            (folder / "a.txt").write_text("a")
            (folder / "b.txt").write_text("b")

    with pytest.raises(ValueError, match=r"b\.txt is not among"):
        write()
    assert not (tmp_path / "out").exists()
