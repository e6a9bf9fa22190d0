"""Files that are whole or absent, arrays without pickle, and the provenance of a folder."""

import io
import json
import struct
import subprocess
import sys
import time
import zipfile

import numpy as np
import pytest

from gspure import files
from gspure.arrays import load_array, load_arrays, save_array, save_arrays
from gspure.errors import InputError
from gspure.files import file_digest
from gspure.provenance import run_of, write_provenance

NUMBERS = {"x": (np.float64, (None,))}


def content(folder):
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_the_files_of_a_folder_appear_together_beside_others(tmp_path):
    for name in ("sub/a", ".gspure-left/a", "other"):  # the second of a killed process
        files.write_text(tmp_path / name, "old")
    with files.filling(tmp_path) as folder:
        for name in ("sub/a", "b"):
            files.write_text(folder / name, "new")
        assert content(tmp_path)["sub/a"] == "old"
        with files.filling(tmp_path):
            assert folder.is_dir()
    assert content(tmp_path) == {"sub/a": "new", "b": "new", "other": "old"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b", "other", "sub"]


@pytest.mark.parametrize("failure", [ZeroDivisionError, KeyboardInterrupt])
def test_work_that_fails_or_is_stopped_leaves_everything_as_it_was(tmp_path, failure):
    def half_written(*paths):
        for path in paths:
            path.write_text("half")
        raise failure

    (tmp_path / "a").write_text("old")
    with pytest.raises(failure), files.filling(tmp_path) as folder, files.replacing(tmp_path / "a") as file:
        half_written(file, folder / "a")
    assert content(tmp_path) == {"a": "old"}
    assert len([*tmp_path.iterdir()]) == 1


SLOW = """
import time
from pathlib import Path
from gspure import __main__, cli
from gspure.files import filling, replacing
def main():
    with replacing(Path("a.txt")) as file, filling(Path("folder")) as folder:
        file.write_text("half")
        (folder / "b.txt").write_text("half")
        Path("ready").touch()
        time.sleep(60)
cli.main = main
raise SystemExit(__main__.main())
"""


def test_a_terminated_command_leaves_no_half_file_and_says_so_in_one_line(tmp_path):
    """By `timeout`, Slurm or `docker stop`."""
    process = subprocess.Popen([sys.executable, "-c", SLOW], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    while not (tmp_path / "ready").exists():
        time.sleep(0.05)
    process.terminate()
    assert process.communicate()[1] == "gspure: interrupted\n"
    assert process.returncode == 143
    assert content(tmp_path) == {"ready": ""}


def with_header(shape):
    """Return an .npy file of 24 bytes with this shape in its header, whatever it is."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header.encode("latin1") + bytes(24)


def stored(array):
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=True)
    return stream.getvalue()


HOSTILE = {
    "no array": b"text",
    "deep nesting": with_header("(" * 9000),
    "a huge length": with_header(f"({10**15},)"),
    "pickled": stored(np.array([{}])),
    "shortened": stored(np.arange(3.0))[:-1],
    "another precision": stored(np.zeros(3, np.float32)),
    "another shape": stored(np.zeros((3, 1))),
    "NaN": stored(np.array([1, np.nan, 2])),
}


@pytest.mark.parametrize("data", HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_array_is_refused_in_one_line(tmp_path, data):
    (tmp_path / "a.npy").write_bytes(data)
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x.npy", data)
    with pytest.raises(InputError, match=r"a\.npy: "):
        load_array(tmp_path / "a.npy", dtype=np.float64, shape=(None,))
    with pytest.raises(InputError, match=r"a\.npz: "):
        load_arrays(tmp_path / "a.npz", NUMBERS, "numbers")


@pytest.mark.parametrize("array", [np.zeros((0, 3)), np.arange(12.0).reshape(3, 4), np.arange(12.0).reshape(4, 3).T])
def test_arrays_are_read_and_written_as_by_numpy(tmp_path, array):
    save_array(tmp_path / "ours.npy", array)
    np.save(tmp_path / "theirs.npy", array)
    np.testing.assert_array_equal(np.load(tmp_path / "ours.npy"), array)
    np.testing.assert_array_equal(load_array(tmp_path / "theirs.npy", dtype=np.float64, shape=(None, None)), array)
    kinds = {"x": (np.float64, (None, None)), "text": (np.str_, ()), "count": (np.integer, ())}
    save_arrays(tmp_path / "ours.npz", {"x": array, "text": np.array("ω"), "count": np.array(7, np.uint16)})
    arrays = load_arrays(tmp_path / "ours.npz", kinds, "numbers")
    np.testing.assert_array_equal(arrays["x"], array)
    assert (str(arrays["text"]), int(arrays["count"])) == ("ω", 7)


def test_nothing_is_pickled(tmp_path):
    with pytest.raises(ValueError, match="objects"):
        save_array(tmp_path / "a.npy", np.array([{}]))


def test_an_archive_that_unpacks_to_far_more_than_its_size_is_refused(tmp_path):
    bomb = zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED)
    with bomb, bomb.open("x.npy", "w") as member:
        member.writelines([with_header(f"({10**7},)")[:-24], *[bytes(10**6)] * 80])
    with pytest.raises(InputError, match=r"a\.npz: x: expected at most \d+ bytes, found 80000\d+ bytes"):
        load_arrays(tmp_path / "a.npz", NUMBERS, "numbers")


def test_provenance_names_inputs_with_their_digests_and_passes_on_the_run(tmp_path):
    public = tmp_path / "public"
    attacked = tmp_path / "attacked"
    model = public / "point_cloud.ply"
    files.write_text(model, "ply")
    write_provenance(public, "embed", inputs={}, settings={"seed": 1}, run="abc")
    write_provenance(attacked, "attack", inputs={"model": model, "folder": public}, settings={"scale": 0.5})
    record = json.loads((attacked / "provenance.json").read_text())
    assert record["inputs"] == {
        "model": {"path": str(model), "sha256": file_digest(model)},
        "folder": {"path": str(public)},
    }
    assert (record["command"], record["settings"]) == ("attack", {"scale": 0.5})
    assert run_of(attacked) == run_of(model) == record["run"] == "abc"
    assert run_of(tmp_path) == ""


def test_provenance_names_the_content_that_was_read_even_if_another_replaces_it(tmp_path):
    file = tmp_path / "cameras.json"
    files.write_text(file, "[1]")
    content_digest = file_digest(file)
    assert files.read_json(file) == [1]
    files.write_text(file, "[2]")
    write_provenance(tmp_path, "render", inputs={"cameras": file}, settings={})
    record = json.loads((tmp_path / "provenance.json").read_text())
    assert record["inputs"]["cameras"]["sha256"] == content_digest != file_digest(file)


def test_a_folder_is_filled_by_one_run_at_a_time(tmp_path):
    with files.filling_alone(tmp_path / "out") as folder:
        (folder / "first").touch()
        with (
            pytest.raises(InputError, match="out: output: expected no other run here"),
            files.alone_in(tmp_path / "out"),
        ):
            pytest.fail("two at once")
    assert content(tmp_path / "out") == {"first": ""}
