"""A seeded part of `make torture`: what every reader makes of corrupted files."""

import contextlib
import io
import json
import os
import subprocess
import sys
import time
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest

from gspure.errors import InputError
from tests.hostile import contract
from tests.hostile.archives import bomb, zip_bomb, zipped
from tests.hostile.contract import READ, REFUSED, Reader, Watch, corrupted, faults_of_line, outcome, prepared, torment
from tests.hostile.journal import kept
from tests.hostile.mutations import FORMS, SPECIAL, mutate
from tests.hostile.readers import BY_NAME, READERS

ROOT = Path(__file__).parents[2]
CASES = 100
NEVER_REFUSED = {"attack.log", "results/jobs/weights.json", "rendered.json"}
"""Logs have any text; a job without a readable note runs again; what has no readable record is no result."""


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """What became of `CASES` files of every reader."""
    folder = tmp_path_factory.mktemp("torture")
    # OpenMP does not survive a fork once it has run, and PyTorch has it.
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    arguments = ["readers", "--cases", str(CASES), "--folder", str(folder)]
    done = subprocess.run(
        [sys.executable, "-m", "tests.hostile", *arguments],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert sum(record["cases"] for record in kept("readers")) > CASES * len(READERS), "the run replaced kept records"
    records = [json.loads(path.read_text()) for path in (folder / "readers").glob("*.json")]
    assert records, done.stderr
    for record in records:
        endings = record["endings"].values()
        assert record["cases"] == CASES == sum(count for counts in endings for count in counts.values())
    return {record["reader"]: record for record in records}


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)
def test_corrupted_files_are_read_or_refused_in_one_line(records, reader):
    if not reader.available:
        pytest.skip("a package that it needs is not installed")
    assert records[reader.name]["violations"] == []


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)
def test_corrupted_files_get_past_their_checksums(records, reader):
    """Each is refused by its parser, too, and some corruptions are harmless; checksums are tried with their records."""
    if not reader.available:
        pytest.skip("a package that it needs is not installed")
    endings = records[reader.name]["endings"]
    assert endings.keys() == reader.targets.keys()
    assert sum(counts.get(READ, 0) for counts in endings.values()) > 0
    for target in reader.targets.keys() - {name.removesuffix(".json") for name in reader.targets} - NEVER_REFUSED:
        assert endings[target].get(REFUSED, 0) > 0, target


def test_a_test_case_is_reproducible(tmp_path):
    pristine, _ = prepared(BY_NAME["clusters"], tmp_path / "reader")
    runs = [[corrupted(BY_NAME["clusters"], case, pristine) for case in range(50)] for _ in range(2)]
    assert runs[0] == runs[1]
    assert len({content for _, _, content in runs[0]}) > 40


@pytest.mark.parametrize("seed", range(2))
def test_a_member_of_an_archive_may_understate_its_size(seed):
    archive = zip_bomb(zipped([("a", b"1"), ("b", b"2")]), np.random.default_rng(seed))
    assert len(archive) < 2 << 20
    with zipfile.ZipFile(io.BytesIO(archive)) as bombed, contextlib.suppress(zipfile.BadZipFile):
        assert max(len(bombed.read(name)) for name in "ab") == bomb()[2]


@pytest.mark.parametrize("form", FORMS)
def test_files_of_every_format_are_corrupted_and_in_the_same_way_at_any_time(tmp_path, monkeypatch, form):
    reader, target = next((r, t) for r in READERS if r.available for t, f in r.targets.items() if f == form)
    reader.build(tmp_path)
    content = (tmp_path / target).read_bytes()
    runs = []
    for seconds in (1e9, 2e9):
        monkeypatch.setattr(time, "time", lambda now=seconds: now)
        runs.append([mutate(form, content, np.random.default_rng(case)) for case in range(100)])
    assert runs[0] == runs[1]
    assert np.mean([changed != content for _, changed in runs[0]]) > 0.8


def test_an_archive_with_a_name_that_cannot_be_encoded_is_the_same_at_any_time(monkeypatch):
    archives = set()
    for seconds in (1e9, 2e9):
        monkeypatch.setattr(time, "time", lambda now=seconds: now)
        archives.add(zipped([("\ud800", b"1")]))
    assert len(archives) == 1


@pytest.mark.parametrize("special", SPECIAL)
@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)
def test_what_is_no_regular_file_is_refused_in_one_line(tmp_path, monkeypatch, reader, special):
    if not reader.available:
        pytest.skip("a package that it needs is not installed")
    monkeypatch.setattr(contract, "mutate", lambda _form, content, _rng: (special, content))
    monkeypatch.setattr(contract, "WALL_SECONDS", 10.0)
    assert [
        v for case in torment(reader, range(len(reader.targets)), tmp_path / "reader") for v in case.violations
    ] == []


def _raise(error):
    raise error


def _compute():
    end = time.process_time() + 0.2
    while time.process_time() < end:
        pass


def _allocate(folder):
    (folder / "file").read_bytes()
    return bytearray(300 << 20)


BREACHES = {
    "KeyError": lambda folder: _raise(KeyError("x")),
    "temporary name": lambda folder: _raise(InputError(f".file.{os.getpid()}", "x", expected="a", found="b")),
    "invalid result": lambda folder: _raise(AssertionError),
    "writes outside": lambda folder: (folder.parent / "outside").write_text("x"),
    "executes": lambda folder: os.system("true"),  # noqa: S605
    "crashes: SIGABRT": lambda folder: os.abort(),
    "memory": _allocate,
    "warns": lambda folder: warnings.warn("x", stacklevel=1),
    "slow": lambda folder: _compute(),
    "hangs": lambda folder: time.sleep(2.0),
    "exits: 3": lambda folder: os._exit(3),
}


@pytest.mark.parametrize("kind", BREACHES)
def test_every_violation_of_the_contract_is_detected(tmp_path, monkeypatch, kind):
    monkeypatch.setattr(contract, "CPU_SECONDS", 0.1)
    if kind == "hangs":
        monkeypatch.setattr(contract, "WALL_SECONDS", 0.5)

    def read(folder):
        if (folder / "file").read_bytes() != b"fine" * 9:
            BREACHES[kind](folder)

    reader = Reader("reader", lambda folder: (folder / "file").write_bytes(b"fine" * 9), read, {"file": "bytes"})
    cases = list(torment(reader, range(3), tmp_path / "reader"))
    assert kind in {violation.kind for case in cases for violation in case.violations}


@pytest.mark.parametrize("line", ["a\nb", "a\x1b[31mb", "a\u2028b", "a\ud800", "a" * 3000], ids=range(5))
def test_a_refusal_must_be_one_short_printable_line(tmp_path, line):
    assert len(list(faults_of_line(line, tmp_path))) == 1
    assert list(faults_of_line("file: x: expected α, found 日本", tmp_path)) == []


def test_a_refusal_in_one_line_is_no_breach(tmp_path):
    def read(folder):
        raise InputError(folder / "file", "x", expected="a", found="b")

    assert outcome(Reader("reader", lambda _: None, read, {}), tmp_path, Watch()) == (REFUSED, [])
