"""Jobs whose failure is noted and stops nothing else."""

import os
import signal
import subprocess
import sys

import pytest

from gspure.cli import main
from gspure.errors import InputError
from gspure.failures import Note, mark_failed, mark_made, note_of
from gspure.model import write_model
from tests.models import blobs

BAD = "attack crop --model model.ply --set keep=7 --out attacked.ply --kept kept.npy"
GOOD = "attack watermarked --model model.ply --out attacked.ply --kept kept.npy"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    write_model(tmp_path / "model.ply", blobs(20, sh_degree=0))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def attempt(command, after="model.ply", makes="attacked.ply kept.npy"):
    line = f"-m gspure attempt --after {after} --makes {makes} --log logs/attack.log -- {command}"
    return subprocess.run([sys.executable, *line.split()], capture_output=True, text=True, check=False)


def test_what_succeeds_leaves_its_files_and_no_note(folder):
    done = attempt(GOOD)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert "kept 20 of 20 rows" in (folder / "logs" / "attack.log").read_text()
    assert not list(folder.glob("*.failed"))


def test_a_failure_is_said_once_noted_beside_every_file_and_is_status_0(folder):
    done = attempt(BAD)
    assert done.returncode == 0
    (line,) = done.stderr.splitlines()
    assert line.startswith("gspure attack: attack crop: setting: expected")
    assert line.endswith("(all of it: logs/attack.log)")
    for name in ("attacked.ply", "kept.npy"):
        assert note_of(folder / name).failures == 1
        assert note_of(folder / name).reason in line
        assert (folder / name).read_text().startswith("This could not be made: gspure attack: ")


def test_what_needs_something_that_failed_is_not_tried_and_tells_the_first_reason(folder):
    attempt(BAD)
    done = attempt(GOOD, after="model.ply attacked.ply", makes="second.ply renders")
    assert (done.returncode, done.stderr) == (0, "")
    assert note_of(folder / "second.ply") == Note(0, note_of(folder / "attacked.ply").reason)
    assert (folder / "renders").is_dir()
    assert "not tried" in (folder / "logs" / "attack.log").read_text()


def test_success_after_a_failure_keeps_the_count_alone(folder):
    attempt(BAD)
    attempt(GOOD)
    assert note_of(folder / "kept.npy") == Note(1, "")


def test_a_crash_is_told_by_the_last_line_of_its_traceback(folder):
    (folder / "sitecustomize.py").write_text("import gspure.cli.info as info\ninfo.run = lambda args: 1 / 0\n")
    line = "-m gspure attempt --makes kept.npy --log info.log -- info model.ply"
    crashing = {**os.environ, "PYTHONPATH": f"{folder}:{os.environ.get('PYTHONPATH', '')}"}
    subprocess.run([sys.executable, *line.split()], env=crashing, check=True)
    assert note_of(folder / "kept.npy") == Note(1, "gspure info: ZeroDivisionError: division by zero")
    assert "Traceback" in (folder / "info.log").read_text()


def test_a_job_that_is_killed_has_failed_and_one_that_is_interrupted_has_not(folder):
    (folder / "sitecustomize.py").write_text(
        "import os, sys\nif 'pair' in sys.argv: os.register_at_fork(after_in_child=lambda: os.kill(os.getpid(), "
        "int(os.environ['ENDED_BY'])))\n"
    )
    line = "-m gspure attempt --makes views.json --log pair.log -- pair room vault --out views"
    for name, status in (("SIGTERM", 128 + signal.SIGTERM), ("SIGKILL", 0)):
        ending = {
            "ENDED_BY": str(int(getattr(signal, name))),
            "PYTHONPATH": f"{folder}:{os.environ.get('PYTHONPATH', '')}",
        }
        done = subprocess.run([sys.executable, *line.split()], env={**os.environ, **ending}, check=False)
        assert done.returncode == status
        noted = note_of(folder / "views.json").reason
        assert noted == ("" if status else "gspure pair: ended by SIGKILL, perhaps for want of memory")


def test_failures_of_a_run_are_told_by_reason(folder, capsys):
    assert main(["failures", "."]) == 0
    mark_failed([folder / "model.ply", folder / "key"], "gspure embed: no room", own=True)
    assert main(["failures", "model.ply"]) == 1
    assert capsys.readouterr().out == "gspure embed: no room: model.ply\n"
    assert main(["failures", "."]) == 1
    assert capsys.readouterr().out == "gspure embed: no room: key and 1 more\n"
    mark_made([folder / "model.ply", folder / "key"])
    assert main(["failures", "."]) == 0


def test_a_note_that_is_none_is_refused(folder):
    (folder / "a.npy.failed").write_text("[]")
    with pytest.raises(InputError, match="a note of failures"):
        mark_made([folder / "a.npy"])
