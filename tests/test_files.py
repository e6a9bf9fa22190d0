"""Files that are whole or absent, arrays without pickle, and the provenance of a folder."""

import io
import json
import struct
import subprocess
import sys
import time
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.errors import InputError
from gspure.files import (
    digest,
    file_digest,
    filling,
    load_array,
    load_arrays,
    replacing,
    run_of,
    save_array,
    save_arrays,
    write_json,
    write_provenance,
)

NUMBERS = {"x": (np.float64, (None,))}
PAIRS = np.dtype([("row", "<u4"), ("value", "<f4")])


def content(folder: Path) -> dict[str, str]:
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_a_file_replaces_another_when_it_is_whole(tmp_path: Path) -> None:
    for text in ("old", "new"):
        with replacing(tmp_path / "sub" / "file.txt") as temporary:
            temporary.write_text(text)
            assert text not in content(tmp_path).get("sub/file.txt", "")
        assert content(tmp_path) == {"sub/file.txt": text}


def test_the_files_of_a_folder_appear_together_beside_others(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "a").write_text("old")
    (tmp_path / "other").write_text("kept")
    with filling(tmp_path) as folder:
        (folder / "sub").mkdir()
        (folder / "sub" / "a").write_text("new")
        (folder / "b").write_text("new")
        assert content(tmp_path)["sub/a"] == "old"
    assert content(tmp_path) == {"sub/a": "new", "b": "new", "other": "kept"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b", "other", "sub"]


@pytest.mark.parametrize("failure", [ZeroDivisionError, KeyboardInterrupt])
@pytest.mark.parametrize("writing", [replacing, filling])
def test_work_that_fails_or_is_stopped_leaves_everything_as_it_was(tmp_path: Path, writing, failure) -> None:
    (tmp_path / "a").write_text("old")

    def half_written(file: Path) -> None:
        file.write_text("half")
        raise failure

    with pytest.raises(failure), writing(tmp_path / "a" if writing is replacing else tmp_path) as temporary:
        half_written(temporary / "a" if writing is filling else temporary)
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


def test_a_terminated_command_leaves_no_half_file_and_says_so_in_one_line(tmp_path: Path) -> None:
    """By `timeout`, Slurm or `docker stop`."""
    process = subprocess.Popen([sys.executable, "-c", SLOW], cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    while not (tmp_path / "ready").exists():
        time.sleep(0.05)
    process.terminate()
    assert process.communicate()[1] == "gspure: interrupted\n"
    assert process.returncode == 143
    assert content(tmp_path) == {"ready": ""}
    assert not [*(tmp_path / "folder").iterdir()]


def test_what_a_killed_process_left_is_removed_and_work_under_way_is_not(tmp_path: Path) -> None:
    (tmp_path / ".gspure-left").mkdir()
    (tmp_path / ".gspure-left" / "half").touch()
    with filling(tmp_path) as first, filling(tmp_path) as second:
        assert {*tmp_path.iterdir()} == {first, second}
    assert not [*tmp_path.iterdir()]


def with_header(shape: str, descr: str = "'<f8'") -> bytes:
    """Return an .npy file of 24 bytes with this shape and type in its header, whatever they are."""
    header = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header.encode("latin1") + bytes(24)


def stored(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


HOSTILE = {
    "empty": b"",
    "no array": b"text",
    "longest header": b"\x93NUMPY\x02\x00\xff\xff\xff\xff",
    "deep nesting": with_header("(" * 9000),
    "a huge length": with_header(f"({10**15},)"),
    "a product beyond int64": with_header(f"({2**40}, {2**40})"),
    "objects": with_header("(3,)", "'O'"),
    "shortened": stored(np.arange(3.0))[:-1],
    "longer": stored(np.arange(3.0)) + b"\0",
    "another precision": stored(np.zeros(3, np.float32)),
    "another shape": stored(np.zeros((3, 1))),
    "NaN": stored(np.array([1, np.nan, 2])),
}


@pytest.mark.parametrize("data", HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_array_is_refused_in_one_line(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.npy").write_bytes(data)
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x.npy", data)
    for name, read in (
        ("a.npy", lambda path: load_array(path, dtype=np.float64, shape=(None,))),
        ("a.npz", lambda path: load_arrays(path, NUMBERS, "numbers")),
    ):
        with pytest.raises(InputError) as caught:
            read(tmp_path / name)
        assert str(caught.value).startswith(f"{tmp_path}/{name}: ")
        assert str(caught.value).isprintable()


@given(st.binary(max_size=200), st.integers(0, 200))
def test_any_change_of_an_array_gives_an_array_or_one_line(tmp_path_factory, patch: bytes, at: int) -> None:
    folder = tmp_path_factory.mktemp("any")
    np.savez(folder / "packed.npz", x=np.arange(3.0))
    for name, whole in (("a.npy", stored(np.arange(3.0))), ("a.npz", (folder / "packed.npz").read_bytes())):
        (folder / name).write_bytes(whole[:at] + patch + whole[at + len(patch) :])
    with suppress(InputError):
        assert load_array(folder / "a.npy", dtype=np.float64, shape=(None,)).dtype == np.float64
    with suppress(InputError):
        assert load_arrays(folder / "a.npz", NUMBERS, "numbers")["x"].dtype == np.float64


@pytest.mark.parametrize("value", [np.inf, -1])
def test_numbers_in_fields_are_checked_too(tmp_path: Path, value: float) -> None:
    save_array(tmp_path / "a.npy", np.array([(1, 0.5), (2, value)], PAIRS))
    with pytest.raises(InputError, match=r"expected finite numbers of at least 0, found .* in row 1"):
        load_array(tmp_path / "a.npy", dtype=PAIRS, shape=(None,), least=0)


@pytest.mark.parametrize("array", [np.zeros((0, 3)), np.arange(12.0).reshape(3, 4), np.arange(12.0).reshape(4, 3).T])
def test_arrays_are_read_as_by_numpy(tmp_path: Path, array: np.ndarray) -> None:
    save_array(tmp_path / "weights", array)
    np.save(tmp_path / "theirs.npy", array)
    save_arrays(tmp_path / "ours.npz", {"x": array, "said": np.array("ω"), "count": np.array(7, np.uint16)})
    np.testing.assert_array_equal(np.load(tmp_path / "weights"), array)
    for name in ("weights", "theirs.npy"):
        np.testing.assert_array_equal(load_array(tmp_path / name, dtype=np.float64, shape=(None, None)), array)
    kinds = {"x": (np.float64, (None, None)), "said": (np.str_, ()), "count": (np.integer, ())}
    found = load_arrays(tmp_path / "ours.npz", kinds, "numbers")
    np.testing.assert_array_equal(found["x"], array)
    assert (str(found["said"]), int(found["count"])) == ("ω", 7)
    with pytest.raises(InputError, match=r"ours\.npz: z: expected numbers, found no such array"):
        load_arrays(tmp_path / "ours.npz", kinds | {"z": (np.float64, ())}, "numbers")


def test_nothing_is_pickled(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="objects"):
        save_array(tmp_path / "a.npy", np.array([{}]))
    np.save(tmp_path / "a.npy", np.array([{}]), allow_pickle=True)
    with pytest.raises(InputError, match="expected numbers, found pickled objects"):
        load_array(tmp_path / "a.npy", dtype=object, shape=(None,))


def test_an_archive_that_unpacks_to_far_more_than_its_size_is_refused(tmp_path: Path) -> None:
    bomb = zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED)
    with bomb, bomb.open("x.npy", "w") as member:
        member.writelines([with_header(f"({10**7},)")[:-24], *[bytes(10**6)] * 80])
    with pytest.raises(InputError, match=r"a\.npz: x: expected at most \d+ bytes, .* found 80000\d+ bytes"):
        load_arrays(tmp_path / "a.npz", NUMBERS, "numbers")
    save_arrays(tmp_path / "b.npz", {"x": np.zeros(10**6)})  # packs well, and is within the room for small files
    assert len(load_arrays(tmp_path / "b.npz", NUMBERS, "numbers")["x"]) == 10**6


def test_digests_depend_on_type_shape_and_boundaries() -> None:
    zeros = [np.zeros(4, np.float32), np.zeros(2, np.float64), np.zeros((2, 2), np.float32)]
    assert len({digest(array) for array in zeros} | {digest("ab", "c"), digest("a", "bc"), digest("abc")}) == 6


def test_provenance_names_inputs_with_their_digests_and_passes_on_the_run(tmp_path: Path) -> None:
    public, made = tmp_path / "public", tmp_path / "made"
    write_json(public / "point_cloud.ply", 1)
    write_provenance(public, "embed", inputs={}, settings={"seed": 1}, run="abc")
    model = public / "point_cloud.ply"
    write_provenance(made, "attack", inputs={"model": model, "folder": public}, settings={"scale": 0.5})
    record = json.loads((made / "provenance.json").read_text())
    assert record["inputs"] == {
        "model": {"path": str(model), "sha256": file_digest(model)},
        "folder": {"path": str(public)},
    }
    assert (record["command"], record["settings"]) == ("attack", {"scale": 0.5})
    assert run_of(made) == run_of(model) == record["run"] == "abc"
    assert run_of(tmp_path) == ""
