"""The parts of `make torture` that take too long for the suite, at a small size."""

import ast
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from benchmarks import drivers
from gspure.artifacts import load_array, read_json, save_array
from gspure.artifacts.checksums import file_checksum
from gspure.errors import InputError
from gspure.images import RENDERED, record_views, require_all_images
from gspure.model import write_model
from gspure.opencl.device import choose_device
from gspure.schemes.registry import BUILT_IN, find_scheme
from tests.hostile import commands, corruption, journal, kills, page, project
from tests.hostile.corruption import CORRUPTIONS
from tests.hostile.journal import Journal
from tests.hostile.kills import hooked
from tests.hostile.mutants import CORE, ROOT, mutants
from tests.hostile.project import Job
from tests.models import AWKWARD, blobs

WRITER = "from pathlib import Path\nfor i in range(5):\n    Path(f'{i}.txt').write_text('x')\n"


def written(folder, **more):
    """Run a program that writes five files one after the other; return its status and the files."""
    folder.mkdir()
    environment = {**os.environ, **hooked(folder, **more)}
    command = [sys.executable, "-c", WRITER]
    done = subprocess.run(command, cwd=folder, env=environment, start_new_session=True, check=False)
    return done.returncode, sorted(path.name for path in folder.glob("*.txt"))


def test_a_job_is_killed_before_the_change_on_disk_that_was_chosen(tmp_path):
    counter = tmp_path / "changes"
    assert written(tmp_path / "whole", HOSTILE_COUNT=str(counter)) == (0, [f"{i}.txt" for i in range(5)])
    assert len(counter.read_bytes()) == 5
    assert written(tmp_path / "killed", HOSTILE_KILL="3") == (-9, ["0.txt", "1.txt"])


@pytest.mark.parametrize(("change", "hit"), [(7, {"change": 5, "hit": True}), (90, {"change": 27, "hit": False})])
def test_a_kill_after_the_end_of_a_job_is_tried_again_earlier(tmp_path, change, hit):
    (tmp_path / "write.py").write_text(WRITER)
    job = Job("write", f"{sys.executable} write.py", (), (), "log")
    assert kills.hit(job, tmp_path, [f"{i}.txt" for i in range(5)], {"change": change}) == hit


def breaches_of(command, folder):
    """How a command breaches the contract of jobs, its status, and whether it opened the model."""
    ended = commands.run(Job("rule", f"python -m gspure {command} > log 2>&1", (), (), "log"), folder)
    return [*commands.breaches(ended, folder)], ended.status, str(folder / "model.ply") in ended.opened


def test_commands_end_with_a_result_or_a_refusal(tmp_path):
    write_model(tmp_path / "model.ply", blobs(4))
    assert breaches_of("info model.ply", tmp_path) == ([], 0, True)
    assert breaches_of("info absent.ply", tmp_path) == ([], 2, False)


def test_errors_and_warnings_of_commands_are_breaches(tmp_path, monkeypatch):
    def fail(_):
        raise KeyError("x")

    monkeypatch.setattr("gspure.cli.info.run", fail)
    (error,), status, _ = breaches_of("info model.ply", tmp_path)
    assert (status, "KeyError" in error) == (1, True)
    (warning,) = commands.breaches(
        commands.Run(0, "a.py:3: RuntimeWarning: overflow\n  x = y\n", frozenset()), tmp_path
    )
    assert "RuntimeWarning" in warning


@pytest.mark.parametrize("name", ["weights.npy", "weights.npy.json"])
def test_forged_artifacts_get_past_their_checksums(tmp_path, name):
    texts = set()
    for seed in range(30):
        save_array(tmp_path / "weights.npy", np.ones(3, np.float32), checksum=True)
        corruption.forge(tmp_path / name, np.random.default_rng(seed))
        try:
            load_array(tmp_path / "weights.npy", dtype=np.float32, shape=(3,))
        except InputError as error:
            texts.add(error.expected)
    assert len(texts) > 2
    assert not any(text.startswith("CRC-32") for text in texts) or name.endswith(".json")


def test_forged_images_fit_the_record_of_their_folder(tmp_path):
    checksums = set()
    for seed in range(10):
        Image.new("RGB", (4, 3)).save(tmp_path / "view.png")
        record_views(tmp_path, {"view": []})
        corruption.forge(tmp_path / "view.png", np.random.default_rng(seed))
        checksums.add(file_checksum(tmp_path / "view.png"))
        assert read_json(tmp_path / RENDERED)["crc32"]["view"] == file_checksum(tmp_path / "view.png")
        require_all_images(tmp_path)
    assert len(checksums) > 5


@pytest.mark.parametrize("how", CORRUPTIONS)
def test_corruption_changes_a_file(how):
    content = bytes(range(256)) * 4
    for seed in range(20):
        assert CORRUPTIONS[how](content, np.random.default_rng(seed)) != content


def test_every_mutant_is_another_program():
    lines = (
        "def f(a: int = 1) -> int:",
        "    'Text 3.'",
        "    if a < 2 and not g(a):",
        "        raise ValueError(a + 1)",
    )
    source = "\n".join((*lines, "    return -a"))
    trees = [ast.unparse(mutant.tree) for mutant in mutants(source)]
    assert len(set(trees)) == len(trees) == 7
    assert all("raise ValueError(a + 1)" in tree and "Text 3." in tree for tree in trees)


def test_the_core_and_its_tests_exist():
    for module, tests in CORE.items():
        assert (ROOT / f"{module.replace('.', '/')}.py").is_file()
        for file, _, test in (name.partition("::") for name in tests):
            assert f"def {test}" in (ROOT / "tests" / file).read_text()


@pytest.mark.workflow
def test_the_projects_run_every_rule_and_every_scheme(tmp_path):
    project.build(tmp_path / "project")
    jobs = project.snakemake(tmp_path / "project", "--dry-run").printed
    assert project.rules() <= {*re.findall(r"^(\w+) +\d+$", jobs, re.MULTILINE)}
    assert {scheme.module for scheme in BUILT_IN} == {
        find_scheme(name).module for config, _ in project.PROJECTS.values() for name in config["schemes"]
    }


def test_artifacts_of_every_scheme_and_their_records_are_corrupted(tmp_path):
    kinds = ("keyss/point_cloud.ply", "planted/point_cloud.ply")
    public = [
        f"results/{scheme}/room_{n}/public/{file}" for scheme, file in (k.split("/") for k in kinds) for n in "12"
    ]
    for name in public:
        save_array(tmp_path / name, np.ones(3), checksum=True)
    jobs = [Job(rule, "", (name,), (), "") for rule in ("attack_model", "render_scene") for name in public]
    cases = [(job.rule, corruption.kind(name)) for job, name in corruption.readings(jobs, tmp_path)]
    assert sorted(kind for _, kind in cases if kind.endswith(".json")) == [f"{kind}.json" for kind in kinds]
    assert {(rule, kind) for rule in ("attack_model", "render_scene") for kind in kinds} < {*cases}
    assert len(cases) == 6


def test_a_stage_and_its_record_are_two_kinds_of_artifacts():
    stages = [f"stages/vanilla/room/contributions/view_{n}.0f.npy" for n in "12"]
    assert {corruption.kind(name) for name in stages} == {"stage"}
    assert {corruption.kind(f"{name}.json") for name in stages} == {"stage.json"}


def test_a_file_that_is_refused_before_it_is_opened_is_forged_too(tmp_path, monkeypatch):
    name = "results/weights.npy"
    for folder in ("reference", "copy"):
        save_array(tmp_path / folder / name, np.ones(3), checksum=True)
    monkeypatch.setattr(commands, "run", lambda *_: commands.Run(2, "gspure weights: weights.npy: cut", frozenset()))
    job = Job("accumulate_weights", "", (name,), (), "")
    record = corruption.read_by(job, name, "truncate", tmp_path / "reference", tmp_path / "copy")
    assert record["forged"] == {"read": 0, "refused": corruption.FORGERIES}
    assert record["faults"] == []


def test_a_case_runs_once(tmp_path):
    journal = Journal(tmp_path)
    assert [journal.record("a case", lambda n: {"n": n}, n)["n"] for n in (1, 2)] == [1, 1]


@pytest.mark.parametrize("fault", [[], ["half-written: weights.npy"]])
def test_the_page_counts_and_lists_open_defects(tmp_path, monkeypatch, fault):
    monkeypatch.setattr(page, "PAGE", tmp_path / "torture.md")
    monkeypatch.setattr(journal, "KEPT", tmp_path)
    kill = {"rule": "span_tree", "seconds": 1.0, "changes": 8, "kills": [{"after": 0.5, "hit": True}], "faults": fault}
    record = Journal(tmp_path / "journal").record("span_tree", lambda: kill)
    journal.keep("kills", [record])
    assert page.write() == bool(fault)
    text = (tmp_path / "torture.md").read_text()
    assert f"| open defects | {len(fault)} |" in text
    assert all(each in text for each in fault)
    assert "| kills that hit a job at work | 1 |" in text
    assert f"| kills | 1 at {record['commit']} |" in text


def test_cases_that_did_not_run_again_keep_their_records(tmp_path, monkeypatch):
    monkeypatch.setattr(journal, "KEPT", tmp_path)
    journal.keep("readers", [{"reader": name, "commit": "old"} for name in "ab"])
    journal.keep("readers", [{"reader": "b", "commit": "new", "printed": "much"}], partial=True)
    assert [(r["reader"], r["commit"]) for r in journal.kept("readers")] == [("a", "old"), ("b", "new"), ("b", "old")]
    journal.keep("kills", [{"rule": rule, "commit": "old"} for rule in "ab"])
    journal.keep("kills", [{"rule": "b", "commit": "new"}], partial=True)
    assert [(r["rule"], r["commit"]) for r in journal.kept("kills")] == [("a", "old"), ("b", "new")]
    journal.keep("kills", [{"rule": "b", "commit": "new"}])
    assert len(journal.kept("kills")) == 1


def test_the_page_is_that_of_the_records(tmp_path, monkeypatch):
    committed = page.PAGE.read_text()
    monkeypatch.setattr(page, "PAGE", tmp_path / "torture.md")
    page.write()
    assert page.PAGE.read_text() == committed


def test_the_comparison_of_drivers_finds_agreement_in_every_product(monkeypatch):
    monkeypatch.setattr(drivers, "CASES", {"flakes": AWKWARD["flakes"]})
    errors = drivers.errors(choose_device(None), "cpu")
    assert errors.keys() == {"image", "contributions", "gradients"}
    assert max(errors.values()) < 1e-4
