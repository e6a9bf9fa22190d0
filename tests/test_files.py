"""Files that are whole or absent, arrays without pickle, provenance; and the one line of an error."""

import io
import json
import re
import shutil
import struct
import subprocess
import sys
import time
import zipfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure import files
from gspure.arrays import load_array, load_arrays, save_array, save_arrays
from gspure.errors import InputError
from gspure.files import file_digest
from gspure.metrics.comparison import ViewMetrics, read_metrics
from gspure.metrics.csv_tables import header
from gspure.model import read_model
from gspure.model.gaussians import CORE
from gspure.provenance import bind_rows, require_rows_of, write_provenance

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


def test_a_terminated_command_leaves_everything_as_it_was_and_says_so_in_one_line(tmp_path):
    """By `timeout`, Slurm or `docker stop`."""
    (tmp_path / "a.txt").write_text("old")
    process = subprocess.Popen([sys.executable, "-c", SLOW], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    while not (tmp_path / "ready").exists():
        time.sleep(0.05)
    process.terminate()
    assert process.communicate()[1] == "gspure: interrupted\n"
    assert process.returncode == 143
    assert content(tmp_path) == {"a.txt": "old", "ready": ""}


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
def test_arrays_are_read_and_written_as_by_numpy_and_objects_are_not_pickled(tmp_path, array):
    save_array(tmp_path / "ours.npy", array)
    np.save(tmp_path / "theirs.npy", array)
    np.testing.assert_array_equal(np.load(tmp_path / "ours.npy"), array)
    np.testing.assert_array_equal(load_array(tmp_path / "theirs.npy", dtype=np.float64, shape=(None, None)), array)
    kinds = {"x": (np.float64, (None, None)), "text": (np.str_, ()), "count": (np.integer, ())}
    save_arrays(tmp_path / "ours.npz", {"x": array, "text": np.array("ω"), "count": np.array(7, np.uint16)})
    arrays = load_arrays(tmp_path / "ours.npz", kinds, "numbers")
    np.testing.assert_array_equal(arrays["x"], array)
    assert (str(arrays["text"]), int(arrays["count"])) == ("ω", 7)
    with pytest.raises(ValueError, match="objects"):
        save_array(tmp_path / "objects.npy", array.astype(object))


def test_an_archive_that_unpacks_to_far_more_than_its_size_is_refused(tmp_path):
    bomb = zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED)
    with bomb, bomb.open("x.npy", "w") as member:
        member.writelines([with_header(f"({10**7},)")[:-24], *[bytes(10**6)] * 80])
    with pytest.raises(InputError, match=r"a\.npz: x: expected at most \d+ bytes, found 80000\d+ bytes"):
        load_arrays(tmp_path / "a.npz", NUMBERS, "numbers")


def test_provenance_names_the_content_that_was_read_even_if_another_replaces_it(tmp_path):
    file = tmp_path / "cameras.json"
    files.write_text(file, "[1]")
    content_digest = file_digest(file)
    assert files.read_json(file) == [1]
    files.write_text(file, "[2]")
    write_provenance(tmp_path, "render", inputs={"cameras": file}, settings={})
    record = json.loads((tmp_path / "provenance.json").read_text())
    assert record["inputs"]["cameras"]["sha256"] == content_digest != file_digest(file)


PLY = "ply\nformat ascii 1.0\nelement vertex 1\n" + "".join(f"property float {name}\n" for name in CORE)
READERS = {"json": files.read_json, "ply": read_model, "csv": read_metrics}
READERS["npy"] = lambda file: load_array(file, dtype=np.float64, shape=(None,))
BROKEN = {  # what a file holds, and what a refusal says of it
    "cut.json": ('[{"id": 0, ', "file: expected JSON, found a syntax error on line 1, column 12"),
    "deep.json": ("[" * 100_000, "found lists in lists, too deep"),
    "other.npy": ("some text, no array", "found another kind of file, or a part"),
    "word.ply": (f"{PLY}end_header\n1 2 none {'1 ' * 8}\n", "found 'none' in place of a number at row 0, column 3"),
    "word.csv": (f"{','.join(header(ViewMetrics))}\nscene,a,truth,x,1,1\n", "row 1: expected one of this table, "),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_described_in_our_own_words(tmp_path, name):
    content, found = BROKEN[name]
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=re.escape(found)):
        READERS[name.rpartition(".")[2]](tmp_path / name)


@pytest.mark.parametrize("name", ["weights.npy", "clusters.npz", "by_provenance.npy"])
def test_an_array_of_rows_is_refused_for_another_model_wherever_it_is_copied(tmp_path, name, capsys):
    model, array = tmp_path / "model.ply", tmp_path / name
    model.write_bytes(b"rows 1 2")
    (np.save if array.suffix == ".npy" else np.savez)(array, np.arange(2))
    require_rows_of(model, array)
    assert "does not name its model" in capsys.readouterr().err
    if name == "by_provenance.npy":
        write_provenance(tmp_path, "purify", inputs={"model": model}, settings={})
    else:
        bind_rows(model, array)
        array = shutil.move(array, tmp_path / f"renamed{array.suffix}")
    assert np.load(array) is not None
    require_rows_of(model, array)
    assert not capsys.readouterr().err
    model.write_bytes(b"rows 2 1")
    with pytest.raises(InputError, match="another model"):
        require_rows_of(model, array)


ANY_TEXT = st.text(st.characters(exclude_categories=()))  # control characters and lone surrogates included


@given(ANY_TEXT, ANY_TEXT, ANY_TEXT, ANY_TEXT, st.none() | ANY_TEXT)
def test_a_message_is_one_printable_line_whatever_a_file_holds(source, field, expected, value, hint):
    message = str(InputError(source, field, expected=expected, found=value * 10_000, hint=hint))
    assert message.isprintable()
    assert len(message.encode()) < 20_000


def test_bad_input_is_caught_as_python_names_it(tmp_path):
    file = tmp_path / "model.ply"
    with pytest.raises(FileNotFoundError, match=r"model\.ply: no such file$"):
        read_model(file)
    file.write_text("no ply")
    with pytest.raises(ValueError, match="a 3DGS"):
        read_model(file)
