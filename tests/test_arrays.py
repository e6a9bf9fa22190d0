"""Arrays on disk that are corrupt or hostile: one line each, and nothing allocated for what a header claims."""

from __future__ import annotations

import io
import resource
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

from gspure.artifacts import load_array, load_arrays, save_array, save_arrays
from gspure.cli import main
from gspure.errors import InputError

NUMBERS = {"x": (np.float64, (None,))}
PAIRS = np.dtype([("row", "<u4"), ("value", "<f4")])


def with_header(header: str, data: bytes = bytes(24), version: tuple[int, int] = (1, 0)) -> bytes:
    """Return an .npy file with this header, whatever it says."""
    length = struct.pack("<H" if version == (1, 0) else "<I", len(header))
    return b"\x93NUMPY" + bytes(version) + length + header.encode("latin1") + data


def described(shape: str = "(3,)", descr: str = "'<f8'") -> str:
    return f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}\n"


def content(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


HOSTILE = {
    "empty": b"",
    "no array": b"text",
    "unknown version": with_header(described(), version=(9, 0)),
    "cut in its header": with_header(described())[:40],
    "longest header": b"\x93NUMPY\x02\x00\xff\xff\xff\xff",
    "unfinished string": with_header("{'descr': '''"),
    "unfinished bracket": with_header("{'descr': ("),
    "deep nesting": with_header("(" * 9000),
    "deep minus": with_header("-" * 9000 + "1"),
    "null": with_header("\0"),
    "no dictionary": with_header("5"),
    "unhashable": with_header("{[]: 1}"),
    "no dtype": with_header(described(descr="'nonsense'")),
    "a long dtype": with_header(described(descr="'<f" + "9" * 40 + "'")),
    "a dtype with a wrong field": with_header(described(descr="[(1, 2, 3, 4)]")),
    "a negative length": with_header(described("(-3,)")),
    "a huge length": with_header(described(f"({10**15},)")),
    "an endless length": with_header(described(f"({10**4000},)")),
    "a product beyond int64": with_header(described(f"({2**40}, {2**40})")),
    "objects": with_header(described(descr="'O'")),
    "shortened": content(np.arange(3.0))[:-1],
    "longer": content(np.arange(3.0)) + b"\0",
    "another type": content(np.arange(3)),
    "another byte order": content(np.arange(3.0).astype(">f8")),
    "NaN": content(np.array([1, np.nan, 2])),
    "infinity": content(np.array([1, np.inf, 2])),
}


@pytest.mark.parametrize("data", HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_npy_is_refused_in_one_line(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "a.npy").write_bytes(data)
    with pytest.raises(InputError) as caught:
        load_array(tmp_path / "a.npy", dtype=np.float64, shape=(None,))
    assert str(caught.value).startswith(f"{tmp_path}/a.npy: ")
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("data", HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_member_of_an_npz_is_refused_in_one_line(tmp_path: Path, data: bytes) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x.npy", data)
    with pytest.raises(InputError) as caught:
        load_arrays(tmp_path / "a.npz", NUMBERS, "numbers")
    assert str(caught.value).startswith(f"{tmp_path}/a.npz: ")
    assert str(caught.value).isprintable()


@given(st.binary(max_size=200), st.integers(0, 200))
def test_any_change_of_an_array_gives_an_array_or_one_line(tmp_path_factory, patch: bytes, at: int) -> None:
    folder = tmp_path_factory.mktemp("any")
    whole = content(np.arange(3.0))
    (folder / "a.npy").write_bytes(whole[:at] + patch + whole[at + len(patch) :])
    np.savez(folder / "a.npz", x=np.arange(3.0))
    packed = (folder / "a.npz").read_bytes()
    (folder / "a.npz").write_bytes(packed[:at] + patch + packed[at + len(patch) :])
    with suppress(InputError):
        assert load_array(folder / "a.npy", dtype=np.float64, shape=(None,)).dtype == np.float64
    with suppress(InputError):
        assert load_arrays(folder / "a.npz", NUMBERS, "numbers")["x"].dtype == np.float64


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_in_fields_are_checked_too(tmp_path: Path, value: float) -> None:
    save_array(tmp_path / "a.npy", np.array([(1, 0.5), (2, value)], PAIRS))
    with pytest.raises(InputError, match=r"expected finite numbers, found others in 1 of 2 places, first .* in row 1"):
        load_array(tmp_path / "a.npy", dtype=PAIRS, shape=(None,))


@pytest.mark.parametrize(
    "array",
    [np.zeros((0, 3)), np.arange(12.0).reshape(3, 4), np.asfortranarray(np.arange(12.0).reshape(3, 4))],
    ids=["empty", "by rows", "by columns"],
)
def test_arrays_are_read_as_by_numpy(tmp_path: Path, array: np.ndarray) -> None:
    save_array(tmp_path / "ours.npy", array)
    np.save(tmp_path / "theirs.npy", array)
    save_arrays(tmp_path / "ours.npz", {"x": array})
    np.testing.assert_array_equal(np.load(tmp_path / "ours.npy"), array)
    for name in ("ours", "theirs"):
        found = load_array(tmp_path / f"{name}.npy", dtype=np.float64, shape=(None, None))
        np.testing.assert_array_equal(found, array)
    (found,) = load_arrays(tmp_path / "ours.npz", {"x": (np.float64, (None, None))}, "numbers").values()
    np.testing.assert_array_equal(found, array)


def test_text_and_whole_numbers_of_any_size_are_read(tmp_path: Path) -> None:
    save_arrays(tmp_path / "a.npz", {"said": np.array("ω"), "count": np.array(7, np.uint16)})
    found = load_arrays(tmp_path / "a.npz", {"said": (np.str_, ()), "count": (np.integer, ())}, "notes")
    assert (str(found["said"]), int(found["count"])) == ("ω", 7)


def test_an_archive_that_unpacks_to_far_more_than_its_size_is_refused_at_once(tmp_path: Path) -> None:
    header = with_header(described(f"({10**8},)"), b"")
    bomb = zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED)
    with bomb, bomb.open("x.npy", "w") as member:
        member.writelines([header, *[bytes(10**6)] * 800])
    assert (tmp_path / "a.npz").stat().st_size < 10**6
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began = time.process_time()
    with pytest.raises(InputError, match=r"a\.npz: x: expected at most \d+ bytes, .* found 800000\d+ bytes"):
        load_arrays(tmp_path / "a.npz", NUMBERS, "numbers")
    assert time.process_time() - began < 0.5
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 50_000  # kilobytes


def test_an_array_that_packs_well_is_read(tmp_path: Path) -> None:
    save_arrays(tmp_path / "a.npz", {"x": np.zeros(10**6)})
    assert (tmp_path / "a.npz").stat().st_size < 10**4
    assert len(load_arrays(tmp_path / "a.npz", NUMBERS, "numbers")["x"]) == 10**6


def test_a_member_larger_than_its_header_is_refused(tmp_path: Path) -> None:
    save_arrays(tmp_path / "a.npz", {"x": np.zeros(100)})
    whole = (tmp_path / "a.npz").read_bytes()
    size = struct.pack("<I", len(content(np.zeros(100))))
    assert size in whole
    (tmp_path / "a.npz").write_bytes(whole.replace(size, struct.pack("<I", len(content(np.zeros(50))))))
    with pytest.raises(InputError, match=r"a\.npz: .*expected"):
        load_arrays(tmp_path / "a.npz", NUMBERS, "numbers")


def encrypted(data: bytes) -> bytes:
    at = data.index(b"PK\x01\x02")
    return data[:6] + b"\x01" + data[7 : at + 8] + b"\x01" + data[at + 9 :]


@pytest.mark.parametrize("packing", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_other_packings_are_refused(tmp_path: Path, packing: int) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w", packing) as archive:
        archive.writestr("x.npy", content(np.zeros(3)))
    with pytest.raises(InputError, match=r"a\.npz: x: expected .* stored or deflated"):
        load_arrays(tmp_path / "a.npz", NUMBERS, "numbers")


def test_an_encrypted_member_is_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("x.npy", content(np.zeros(3)))
    (tmp_path / "a.npz").write_bytes(encrypted((tmp_path / "a.npz").read_bytes()))
    with pytest.raises(InputError, match=r"a\.npz: file: expected numbers, found .*encrypted"):
        load_arrays(tmp_path / "a.npz", NUMBERS, "numbers")


def test_a_flipped_bit_in_an_npz_is_detected_by_its_own_checksum(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", x=np.arange(100.0))
    data = bytearray((tmp_path / "a.npz").read_bytes())
    data[300] ^= 1
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(InputError, match=r"a\.npz: file: expected numbers, found Bad CRC"):
        load_arrays(tmp_path / "a.npz", NUMBERS, "numbers")


LIMITED = """
import resource, sys
from gspure.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))
sys.exit(main(sys.argv[1:]))
"""


WRITING = {"features --model model.ply --weights w.npy": "out.npy", "attack unattacked --model model.ply": "out.ply"}


@pytest.mark.parametrize(("command", "out"), WRITING.items())
def test_a_limit_on_file_sizes_is_one_line_with_the_name_of_the_file(tmp_path: Path, command: str, out: str) -> None:
    from gspure.model import write_model
    from tests.models import blobs

    write_model(tmp_path / "model.ply", blobs(300))
    save_array(tmp_path / "w.npy", np.ones(300, np.float32))
    line = [sys.executable, "-c", LIMITED, *command.split(), "--out", f"deep/{out}"]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == f"gspure {command.split(maxsplit=1)[0]}: deep/{out}: File too large\n"
    assert not list((tmp_path / "deep").iterdir())


def test_a_full_disk_is_one_line_with_the_name_of_the_file(tmp_path: Path, monkeypatch, capsys) -> None:
    from gspure.model import write_model
    from tests.models import blobs

    monkeypatch.chdir(tmp_path)
    write_model(Path("model.ply"), blobs(30))
    save_array(Path("w.npy"), np.ones(30, np.float32))

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("gspure.artifacts.arrays.npy.write_array_header_1_0", full)
    assert main(["features", "--model", "model.ply", "--weights", "w.npy", "--out", "out.npy"]) == 2
    assert capsys.readouterr().err == "gspure features: out.npy: No space left on device\n"
