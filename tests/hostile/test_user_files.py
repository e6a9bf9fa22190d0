"""Readers of users' files on corrupt ones: each reads what it gets or refuses it in one line, in little memory.

Hypothesis mutates whole files: bytes, and what lies below a format's packing, where checksums would hide it. The
variable ``GSPURE_EXAMPLES`` sets how many examples of each file are tried.
"""

import gzip
import io
import json
import os
import resource
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gspure.cameras import read_cameras, read_points
from gspure.cameras.reading import read_lenses
from gspure.errors import InputError
from gspure.images import read_image
from gspure.model import read_model
from gspure.model.inria import training_arguments
from gspure.model.ply import read_point_ply
from gspure.model.summary import summarize
from tests.compressed_cases import files as compressed_files

EXAMPLES = int(os.environ.get("GSPURE_EXAMPLES", "25"))
MOST_MEMORY = 1 << 29  # bytes by which one file may raise the memory of the process

NUMBERS = [0, 1, -1, 2**31, 2**32 - 1, 2**63, 10**400, 1e308, float("inf"), float("nan")]
VALUES = st.sampled_from([*NUMBERS, None, True, "", "nan", "../../x", "\x1b[2J\n", [], [[]], {}, [1e30] * 3])
WORDS = [b"nan", b"inf", b"-1", b"1e999", b"99999999999999999999", b"\xff", b"", b"0", b"list uchar int", b"#"]


def drawn_bytes(data: st.DataObject, content: bytes) -> bytes:
    """Cut, insert or overwrite some bytes."""
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, max(len(content) - 1, 0)))
        length = data.draw(st.sampled_from([0, 1, 1, 4, 40, len(content)]))
        same = [byte * length for byte in (b"\0", b"\xff", b"\x7f", b"\x80", b"\x01")]
        new = b"" if length == len(content) else data.draw(st.sampled_from([b"", *same]) | st.binary(max_size=8))
        content = content[:at] + new + content[at + length :]
    return content


def drawn_words(data: st.DataObject, content: bytes) -> bytes:
    """Replace words of a text or of a header."""
    head, end, body = content.partition(b"end_header\n")
    lines = [line.split(b" ") for line in head.split(b"\n")]
    for _ in range(data.draw(st.integers(1, 3))):
        line = lines[data.draw(st.integers(0, len(lines) - 1))]
        line[data.draw(st.integers(0, len(line) - 1))] = data.draw(st.sampled_from(WORDS))
    if data.draw(st.booleans()):
        lines.insert(data.draw(st.integers(0, len(lines))), lines[data.draw(st.integers(0, len(lines) - 1))])
    return b"\n".join(map(b" ".join, lines)) + end + body


def drawn_json(data: st.DataObject, content: bytes) -> bytes:
    """Replace or remove a value of a JSON text, wherever it is nested."""
    value = json.loads(content)
    for _ in range(data.draw(st.integers(1, 2))):
        value = _changed(data, value)
    return json.dumps(value).encode()


def _changed(data: st.DataObject, value: Any) -> Any:
    if not isinstance(value, dict | list) or not value or data.draw(st.integers(0, 3)) == 0:
        return data.draw(VALUES)
    key = data.draw(st.sampled_from([*value] if isinstance(value, dict) else range(len(value))))
    changed = value.copy()
    if data.draw(st.integers(0, 3)) == 0:
        del changed[key]
    else:
        changed[key] = _changed(data, value[key])
    return changed


def drawn_gzip(data: st.DataObject, content: bytes) -> bytes:
    return gzip.compress(drawn_bytes(data, gzip.decompress(content)), 1)


def drawn_zip(data: st.DataObject, content: bytes) -> bytes:
    """Change the content of one member of an archive."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = data.draw(st.sampled_from([*members]))
    members[name] = (drawn_json if name.endswith(".json") else drawn_bytes)(data, members[name])
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for member, value in members.items():
            archive.writestr(member, value)
    return stream.getvalue()


def read_any_model(path: Path) -> None:
    summarize(read_model(path))


def read_colmap(path: Path) -> None:
    for read in (read_lenses, read_points):
        try:
            read(path.parent)
        except InputError:
            if read is read_points:
                raise


Mutator = Callable[[st.DataObject, bytes], bytes]
BYTES: tuple[Mutator, ...] = (drawn_bytes,)
TEXT: tuple[Mutator, ...] = (drawn_bytes, drawn_words)
JSON: tuple[Mutator, ...] = (drawn_json, drawn_json, drawn_json, drawn_bytes)
ZIPPED: tuple[Mutator, ...] = (drawn_gzip, drawn_gzip, drawn_bytes)
ARCHIVE: tuple[Mutator, ...] = (drawn_zip, drawn_zip, drawn_bytes)
CORPUS = Path(__file__).with_name("corpus")
FILES = {path.name: path.read_bytes() for path in CORPUS.iterdir() if path.is_file()} | compressed_files()
COLMAP = {path.name: path.read_bytes() for path in (CORPUS / "colmap").iterdir()}
CASES: dict[str, tuple[tuple[Mutator, ...], Callable[[Path], object]]] = {
    "model.ply": (TEXT, read_any_model),
    "ascii.ply": (TEXT, read_any_model),
    "points.ply": (TEXT, read_point_ply),
    "cfg_args": (TEXT, lambda path: training_arguments(path.parent)),
    "cameras.json": (JSON, read_cameras),
    "transforms.json": (JSON, read_lenses),
    "a.png": (BYTES, read_image),
    "a.tiff": (BYTES, read_image),
    **dict.fromkeys(COLMAP, (TEXT, read_colmap)),
    "model.splat": (BYTES, read_any_model),
    "v3.spz": (ZIPPED, read_any_model),
    "v4.spz": (BYTES, read_any_model),
    "model.sog": (ARCHIVE, read_any_model),
    "model.compressed.ply": (TEXT, read_any_model),
}
"""By the name of a file: what happens to it, and its reader."""


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", CASES)
@settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_a_corrupt_file_is_read_or_refused_in_one_line(tmp_path: Path, name: str, data: st.DataObject) -> None:
    mutators, read = CASES[name]
    beside = {file: content for file, content in COLMAP.items() if name in COLMAP and file[-4:] == name[-4:]}
    for each, content in (beside or {name: FILES[name]}).items():
        (tmp_path / each).unlink(missing_ok=True)  # a model that was read before may still be mapped
        (tmp_path / each).write_bytes(content if each != name else data.draw(st.sampled_from(mutators))(data, content))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        read(tmp_path / name)
    except InputError as error:
        message = str(error)
        assert str(tmp_path) in message
        assert message.isprintable()
        assert len(message) < 3000
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < MOST_MEMORY


@pytest.mark.parametrize("name", ["model.ply", "model.splat", "v3.spz", "model.sog", "cameras.json", "a.png"])
def test_a_pipe_or_a_device_is_refused(tmp_path: Path, name: str) -> None:
    _, read = CASES[name]
    os.mkfifo(tmp_path / name)
    with pytest.raises(InputError):
        read(tmp_path / name)
    (tmp_path / name).unlink()
    (tmp_path / name).symlink_to("/dev/zero")
    with pytest.raises(InputError):
        read(tmp_path / name)
