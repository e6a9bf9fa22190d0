"""Checksums: corruption is found when a file is read; a file without a checksum is read as it is."""

from __future__ import annotations

import json
import shutil
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from gspure.artifacts import (
    file_digest,
    filling,
    load_array,
    load_arrays,
    read_json,
    save_array,
    save_arrays,
    write_json,
    write_record,
    write_text,
)
from gspure.artifacts.checksums import file_checksum, intact, record_file, record_of
from gspure.cameras import read_cameras, write_cameras
from gspure.errors import InputError
from gspure.evaluation import metrics
from gspure.evaluation.comparison import ViewMetrics, read_metrics, write_metrics
from gspure.method.contributions import Measurement, read_index, write_index
from gspure.model import read_model, write_model
from gspure.model.points import read_point_ply, write_point_ply
from tests.models import blobs, camera

METRICS = [ViewMetrics("scene", "view_0", "render", dict.fromkeys(metrics.METRICS, 0.5))]
KINDS = {
    "weights.npy": (
        lambda path: save_array(path, np.arange(50.0)),
        lambda path: load_array(path, dtype=np.float64, shape=(None,)),
    ),
    "clusters.npz": (
        lambda path: save_arrays(path, {"x": np.arange(50.0)}),
        lambda path: load_arrays(path, {"x": (np.float64, (None,))}, "numbers"),
    ),
    "model.ply": (lambda path: write_model(path, blobs(20)), read_model),
    "points3D.ply": (lambda path: write_point_ply(path, np.eye(3), np.eye(3, dtype=np.uint8)), read_point_ply),
    "cameras.json": (lambda path: write_cameras(path, [camera(40, 30)]), read_cameras),
    "verdict.json": (lambda path: write_json(path, {"reached": {}}), read_json),
    "metrics.csv": (lambda path: write_metrics(path, METRICS), read_metrics),
    "1.tsv": (lambda path: write_index(path, [], Measurement("model", "settings", "device", 0)), read_index),
}


def flipped(path: Path, at: int = -8) -> None:
    data = bytearray(path.read_bytes())
    data[at] ^= 1
    path.write_bytes(data)


def written(folder: Path, name: str) -> Path:
    KINDS[name][0](folder / name)
    write_record(folder / name, inputs={}, settings={})
    return folder / name


@pytest.mark.parametrize("name", KINDS)
def test_a_flipped_bit_is_found_when_the_file_is_read(tmp_path: Path, name: str) -> None:
    path, read = written(tmp_path, name), KINDS[name][1]
    read(path)
    expected = file_checksum(path)
    flipped(path)
    with pytest.raises(InputError) as caught:
        read(path)
    said = f"{path}: content: expected CRC-32 {expected}, found {file_checksum(path)} "
    assert str(caught.value).startswith(said)
    assert f"{name}.json" in caught.value.hint


def test_a_folder_that_moves_keeps_its_checksums_and_a_file_copied_alone_has_none(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    written(tmp_path / "a", "weights.npy")
    (tmp_path / "a").rename(tmp_path / "b")
    flipped(tmp_path / "b" / "weights.npy")
    with pytest.raises(InputError, match="expected CRC-32"):
        KINDS["weights.npy"][1](tmp_path / "b" / "weights.npy")
    shutil.copy(tmp_path / "b" / "weights.npy", tmp_path / "mine.npy")
    assert len(KINDS["weights.npy"][1](tmp_path / "mine.npy")) == 50


def test_a_link_to_a_file_has_its_record_until_it_is_replaced(tmp_path: Path) -> None:
    path = written(tmp_path, "weights.npy")
    link = tmp_path / "link.npy"
    link.symlink_to(path.name)
    assert record_of(link) == record_of(path) is not None
    save_array(link, np.arange(9.0))
    assert record_of(link) is None
    assert intact(path)


def test_a_writer_that_is_killed_leaves_no_checksum_of_another_file(tmp_path: Path) -> None:
    path, read = written(tmp_path, "weights.npy"), KINDS["weights.npy"][1]
    save_array(path, np.arange(9.0))  # and killed before it writes the provenance
    assert len(read(path)) == 9


def test_files_that_appear_together_lose_their_old_checksums(tmp_path: Path) -> None:
    path, read = written(tmp_path, "weights.npy"), KINDS["weights.npy"][1]
    with filling(tmp_path, "*.npy") as folder:
        save_array(folder / "weights.npy", np.arange(9.0))
        write_record(folder / "weights.npy", inputs={}, settings={"new": True})
        save_array(folder / "other.npy", np.arange(9.0))
    assert len(read(path)) == 9
    assert read_json(tmp_path / "weights.npy.json")["settings"] == {"new": True}


def test_a_file_whose_record_names_another_is_not_intact(tmp_path: Path) -> None:
    save_array(tmp_path / "a.npy", np.arange(3), checksum=True)
    assert intact(tmp_path / "a.npy")
    record = tmp_path / "a.npy.json"
    record.write_text(record.read_text().replace("a.npy", "b.npy"))
    assert not intact(tmp_path / "a.npy")


def test_a_users_json_beside_a_file_is_not_taken_for_a_checksum(tmp_path: Path) -> None:
    write_json(tmp_path / "model.ply.json", {"title": "my model"})
    KINDS["model.ply"][0](tmp_path / "model.ply")
    KINDS["model.ply"][1](tmp_path / "model.ply")
    assert read_json(tmp_path / "model.ply.json") == {"title": "my model"}


@pytest.mark.parametrize(
    "edit",
    [
        lambda text: text[:-20],
        lambda text: "",
        lambda text: "\0" * 80,
        lambda text: text.replace('"crc32"', '"crc30"'),
        lambda text: text.replace('"crc32": "', '"crc32": 1, "x": "'),
        lambda text: "[" * 100_000,
    ],
    ids=["cut", "empty", "zeros", "no checksum", "a number", "deep"],
)
def test_corrupt_provenance_is_one_line_that_names_it(tmp_path: Path, edit) -> None:
    path = written(tmp_path, "weights.npy")
    note = tmp_path / "weights.npy.json"
    note.write_text(edit(note.read_text()))
    with pytest.raises(InputError) as caught:
        KINDS["weights.npy"][1](path)
    assert str(caught.value).startswith(f"{note}: ")
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(("key", "value"), [("crc32", 7), ("artifact", None)])
def test_provenance_of_another_type_is_quoted(tmp_path: Path, key: str, value: object) -> None:
    path = written(tmp_path, "weights.npy")
    write_json(tmp_path / "weights.npy.json", {"artifact": "weights.npy", "crc32": "0", key: value})
    with pytest.raises(InputError, match=rf"json: record: expected two texts, .* {key} {value}"):
        KINDS["weights.npy"][1](path)


def test_a_flipped_bit_in_a_record_is_found(tmp_path: Path) -> None:
    path = written(tmp_path, "weights.npy")
    record = record_of(path)
    content = record_file(path).read_bytes()
    for place in range(len(content)):
        record_file(path).write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
        with suppress(InputError):
            assert (record_of(path) or {}).items() >= {k: v for k, v in record.items() if k != "record"}.items()


def test_the_digest_of_an_input_is_the_one_that_was_verified(tmp_path: Path) -> None:
    source = written(tmp_path, "weights.npy")
    write_text(tmp_path / "mine.txt", "mine")
    write_text(tmp_path / "out.txt", "out")
    inputs = {"weights": source, "mine": tmp_path / "mine.txt", "folder": tmp_path}
    write_record(tmp_path / "out.txt", inputs=inputs, settings={})
    recorded = json.loads((tmp_path / "out.txt.json").read_text())["inputs"]
    assert {name: entry["digest"] for name, entry in recorded.items()} == {
        "weights": file_digest(source),
        "mine": file_digest(tmp_path / "mine.txt"),
    }
