"""Files and folders of results: whole or absent, and checked when read."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gspure.artifacts import digest, filling, load_array, load_arrays, read_json, replacing, save_array, save_arrays
from gspure.errors import InputError

X = {"x": (np.int64, (None,))}


def half_written(path: Path) -> None:
    path.write_text("half")
    raise ZeroDivisionError


def content(folder: Path) -> dict[str, str]:
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_a_file_appears_when_it_is_whole(tmp_path: Path) -> None:
    with replacing(tmp_path / "new" / "file.txt") as temporary:
        temporary.write_text("whole")
        assert not (tmp_path / "new" / "file.txt").exists()
    assert content(tmp_path) == {"new/file.txt": "whole"}


def test_a_failed_write_keeps_the_existing_file(tmp_path: Path) -> None:
    (tmp_path / "file.txt").write_text("old")
    with pytest.raises(ZeroDivisionError), replacing(tmp_path / "file.txt") as temporary:
        half_written(temporary)
    assert content(tmp_path) == {"file.txt": "old"}


def test_a_device_or_a_pipe_is_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="pipe: output: expected a regular file"):
        save_array(tmp_path / "pipe", np.arange(3.0))
    assert (tmp_path / "pipe").is_fifo()


def test_the_files_of_a_folder_appear_together_beside_those_of_others(tmp_path: Path) -> None:
    (tmp_path / "out" / "sub").mkdir(parents=True)
    (tmp_path / "out" / "sub" / "a").write_text("old")
    (tmp_path / "out" / "other").write_text("kept")
    with filling(tmp_path / "out", "b", "sub/*") as folder:
        (folder / "sub").mkdir()
        (folder / "sub" / "a").write_text("new")
        (folder / "b").write_text("new")
        assert content(tmp_path / "out")["sub/a"] == "old"
    assert content(tmp_path / "out") == {"sub/a": "new", "b": "new", "other": "kept"}
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["b", "other", "sub"]


@pytest.mark.parametrize("there", [True, False])
def test_nothing_of_a_folder_appears_when_the_work_fails(tmp_path: Path, there: bool) -> None:
    out = tmp_path / "deep" / "out"
    if there:
        out.mkdir(parents=True)
    with pytest.raises(ZeroDivisionError), filling(out, "a") as folder:
        half_written(folder / "a")
    assert [path.name for path in tmp_path.rglob("*")] == (["deep", "out"] if there else [])


def test_a_folder_that_a_killed_process_with_the_same_number_left_is_no_obstacle(tmp_path: Path) -> None:
    (tmp_path / f".{os.getpid()}").mkdir()
    with filling(tmp_path, "a") as folder, filling(tmp_path, "b") as other:  # the second in another container
        (folder / "a").write_text("a")
        (other / "b").write_text("b")
    assert {"a", "b"} <= {path.name for path in tmp_path.iterdir()}


def test_only_folders_that_killed_processes_left_are_removed(tmp_path: Path) -> None:
    waiting = f"""
from pathlib import Path
from gspure.artifacts import filling
with filling(Path({str(tmp_path)!r}), "a") as folder:
    (folder / "a").touch()
    print(folder, flush=True)
    input()
"""
    killed, working = (
        subprocess.Popen([sys.executable, "-c", waiting], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    )
    with killed, working:
        left, used = (Path(process.stdout.readline().strip()) for process in (killed, working))
        killed.kill()
        killed.wait()
        assert left.is_dir()
        with filling(tmp_path, "b") as folder:
            (folder / "b").touch()
        assert {path.name for path in tmp_path.iterdir()} == {"b", used.name}
        working.communicate("\n")
    assert {path.name for path in tmp_path.iterdir()} == {"a", "b"}


def test_a_folder_whose_creation_is_interrupted_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mkdir = Path.mkdir

    def interrupted(folder: Path, *args: object, **settings: object) -> None:
        mkdir(folder, *args, **settings)
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "mkdir", interrupted)
    with pytest.raises(KeyboardInterrupt), filling(tmp_path / "out"):
        pass
    assert not any(tmp_path.iterdir())


def test_an_array_is_read_back_under_any_file_name(tmp_path: Path) -> None:
    for name in ("a.npy", "weights", "a.b"):
        save_array(tmp_path / name, np.arange(3.0))
        np.testing.assert_array_equal(load_array(tmp_path / name, dtype=np.float64, shape=(None,)), np.arange(3.0))
    assert len([*tmp_path.iterdir()]) == 3


@pytest.mark.parametrize(
    ("array", "refusal"),
    [
        (np.zeros(3, np.float32), r"array: expected float64 \[any, 2\], found float32 \[3\]"),
        (np.zeros((3, 1)), r"array: expected float64 \[any, 2\], found float64 \[3, 1\]"),
        (
            np.array([[0, np.nan], [np.inf, 1]]),
            "array: expected finite numbers, found others in 2 of 4 places, first nan in row 0",
        ),
    ],
)
def test_an_array_of_another_kind_is_refused(tmp_path: Path, array: np.ndarray, refusal: str) -> None:
    save_array(tmp_path / "a.npy", array)
    with pytest.raises(InputError, match=r"a\.npy: " + refusal):
        load_array(tmp_path / "a.npy", dtype=np.float64, shape=(None, 2))


def test_pickled_objects_are_not_read(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([{}]), allow_pickle=True)
    with pytest.raises(InputError, match="expected numbers, found pickled objects"):
        load_array(tmp_path / "a.npy", dtype=object, shape=(None,))


def test_named_arrays_are_read_back(tmp_path: Path) -> None:
    save_arrays(tmp_path / "a.npz", {"x": np.arange(3), "y": np.ones(2)})
    (x,) = load_arrays(tmp_path / "a.npz", X, "numbers").values()
    np.testing.assert_array_equal(x, np.arange(3))
    with pytest.raises(InputError, match=r"a\.npz: z: expected numbers, found no such array"):
        load_arrays(tmp_path / "a.npz", X | {"z": (np.float64, ())}, "numbers")
    with pytest.raises(InputError, match=r"a\.npz: y: expected integer \[any\], found float64 \[2\]"):
        load_arrays(tmp_path / "a.npz", X | {"y": (np.integer, (None,))}, "numbers")
    save_array(tmp_path / "lone.npz", np.ones(2))
    with pytest.raises(InputError, match=r"lone\.npz: file: expected numbers, found File is not a zip file"):
        load_arrays(tmp_path / "lone.npz", X, "numbers")


def test_digests_depend_on_type_shape_and_boundaries() -> None:
    zeros = [np.zeros(4, np.float32), np.zeros(2, np.float64), np.zeros((2, 2), np.float32)]
    assert len({digest(array) for array in zeros} | {digest("ab", "c"), digest("a", "bc"), digest("abc")}) == 6


def test_json_that_repeats_a_name_is_refused(tmp_path: Path) -> None:
    (tmp_path / "cameras.json").write_text('[{"fx": 50, "view": {"fx": 1}, "fx": 128.7}]')
    with pytest.raises(InputError, match="'fx' twice"):
        read_json(tmp_path / "cameras.json")


def test_json_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text('{"a": 1}', encoding="utf-8-sig")
    assert read_json(tmp_path / "a.json") == {"a": 1}
