"""``gspure audit``: the workflow on a model or a configuration, in the current folder."""

import re
from math import inf
from pathlib import Path

import pytest
import yaml

from gspure.cameras import write_cameras
from gspure.cli import audit, main
from gspure.files import alone_in, write_json
from gspure.model import write_model
from gspure.workflow import auditing
from tests.models import blobs, tilted_camera
from tests.workflow_cases import ROOT, configuration


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_model(tmp_path / "my model.ply", blobs(30))
    return tmp_path


@pytest.fixture
def words(monkeypatch):
    """The options of Snakemake, which is not started."""
    started = []
    for module in (audit, auditing):
        monkeypatch.setattr(module, "run_workflow", lambda options, *_: not started.extend(options))
    monkeypatch.setattr(audit, "_answer", lambda *_, **__: [inf])
    return started


def test_a_model_becomes_a_configuration_that_another_model_does_not_replace(folder, words, capsys):
    assert main(["audit", "my model.ply", "--cameras", "orbit", "--up", "0", "0", "1", "--cores", "1"]) == 0
    file = Path(words[words.index("--configfile") + 1])
    (asset,) = configuration(yaml.safe_load(file.read_text())).assets.values()
    assert (asset.model, asset.cameras, asset.generated.up) == ("my model.ply", "orbit", (0, 0, 1))
    assert Path(words[words.index("--snakefile") + 1]) == ROOT / "Snakefile"
    assert words[words.index("--cores") + 1] == "1"


def test_another_model_or_suite_has_a_folder_of_its_own(folder, words, monkeypatch, capsys):
    places = []

    def place_of(*command: str) -> str:
        assert main(["audit", *command, "--cameras", "orbit"]) == 0
        (newest,) = {*folder.rglob("audit.yaml")} - {*places}
        places.append(newest)
        return newest.parents[1].relative_to(folder).as_posix()

    (folder / "elsewhere").mkdir()
    for model in ("other.ply", "elsewhere/my model.ply", "elsewhere/other.ply"):
        write_model(folder / model, blobs(30))
    assert place_of("my model.ply") == "."
    assert place_of("other.ply") == "audit-other"
    assert place_of("elsewhere/my model.ply") == "audit-my_model"
    assert place_of("elsewhere/other.ply") == "audit-other-2"
    assert place_of("other.ply", "--everyday") == "audit-other-everyday-1"
    assert place_of("other.ply", "--out", "mine") == "mine"
    assert main(["audit", "other.ply", "--cameras", "orbit"]) == 0
    assert len({*folder.rglob("audit.yaml")}) == len(places)
    monkeypatch.setattr(audit, "forecast", lambda _: [Path.cwd().name])
    assert main(["audit", "other.ply", "--cameras", "orbit", "--dry-run"]) == 0
    assert capsys.readouterr().out.endswith("audit-other\n")


def test_a_second_audit_in_a_folder_is_refused_at_once(folder, words, capsys):
    with alone_in(folder):
        assert main(["audit", "my model.ply", "--cameras", "orbit"]) == 2
    assert "output: expected no other run here, found one that runs" in capsys.readouterr().err
    assert not (folder / "results").exists()
    assert main(["audit", "my model.ply", "--cameras", "orbit"]) == 0


def test_the_key_s_pair_has_the_views_and_the_message(folder, words):
    provenance = {"settings": {"scheme": "planted"}, "inputs": {"pair": {"path": "pair"}}}
    write_json(folder / "run" / "marked" / "key" / "provenance.json", provenance)
    for place in ("", "run/pair", "run/pair/message"):  # the pair's path began in the folder where it was made
        write_cameras(folder / place / "cameras.json", [tilted_camera(8, 6)])
    command = ["audit", "my model.ply", "--key", "run/marked/key"]
    assert main(command) == 0
    config = yaml.safe_load(Path(words[words.index("--configfile") + 1]).read_text())
    (asset,) = config["assets"].values()
    places = {"cameras": str(folder / "run/pair"), "message": str(folder / "run/pair/message")}
    assert asset == {"model": "my model.ply", "key": "run/marked/key", **places}
    assert {"unattacked", "gspure", "distil", "jpeg"} < {*configuration(config).variants}
    assert main([*command, "--everyday"]) == 0
    config = configuration(yaml.safe_load(Path("audit-my_model-everyday-1", words[-1]).read_text()))
    assert {"half", "sog", "detail_quarter", "merge"} < {*config.variants}


def test_a_folder_without_provenance_is_no_key(folder, words, capsys):
    (folder / "nokey").mkdir()
    assert main(["audit", "my model.ply", "--key", "nokey"]) == 2
    assert "nokey: key: expected a key of gspure, found no provenance.json" in capsys.readouterr().err


def test_views_are_those_beside_the_model_or_generated(folder, words, capsys):
    assert main(["audit", "my model.ply"]) == 0
    write_cameras(folder / "cameras.json", [tilted_camera(8, 6)])
    assert main(["audit", "my model.ply"]) == 0
    assert re.findall("views (.+)", capsys.readouterr().err) == ["orbit", "."]


def test_a_configuration_is_used_as_it_is_and_further_options_reach_snakemake(folder, words, capsys):
    Path("mine.yaml").write_text("{}")
    assert main(["audit", "mine.yaml", "--cameras", "orbit"]) == 2
    assert "mine.yaml: options: expected none of a model beside a configuration" in capsys.readouterr().err
    assert main(["audit", "mine.yaml", "--", "--forcerun", "all"]) == 0
    assert words[words.index("--configfile") + 1 :] == ["mine.yaml", "--forcerun", "all"]
