"""Downloads that go on where they were cut off, and archives of which only what is needed is unpacked."""

import hashlib
import json
import re
import stat
import threading
import zipfile
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

from gspure.cli import main
from gspure.datasets import ARCHIVES, SCENES, Archive, archive_of, extract, fetch, fetching
from gspure.errors import InputError

CONTENT = np.random.default_rng(0).bytes(300_000)
PIECE = 131_072


class Server:
    """A web server with one file, that hangs up when it has sent so many bytes in answer to one request."""

    def __init__(self, content=CONTENT, *, hang_up_after=None, version="one"):
        self.content, self.hang_up_after, self.version = content, hang_up_after, version
        self.length = None
        self.asked = []

    def __enter__(self):
        self.http = ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, self))
        self.thread = threading.Thread(target=self.http.serve_forever, args=(0.01,))
        self.thread.start()
        self.url = f"http://127.0.0.1:{self.http.server_port}/scenes.zip"
        return self

    def __exit__(self, *failure):
        self.http.shutdown()
        self.http.server_close()
        self.thread.join()


class Handler(BaseHTTPRequestHandler):
    def __init__(self, server, *arguments):
        self.file = server
        super().__init__(*arguments)

    def log_message(self, *words):
        pass

    def do_HEAD(self):
        if self.path == "/scenes.zip":
            self.begin(200, 0)
        else:
            self.send_error(404)

    def do_GET(self):
        asked = self.headers["Range"]
        self.file.asked.append(asked)
        continued = asked and self.headers["If-Range"] == f'"{self.file.version}"'
        start = int(asked.removeprefix("bytes=").removesuffix("-")) if continued else 0
        self.begin(206 if continued else 200, start)
        rest = self.file.content[start:]
        self.wfile.write(rest[: self.file.hang_up_after])

    def begin(self, status, start):
        total = len(self.file.content)
        self.send_response(status)
        self.send_header("ETag", f'"{self.file.version}"')
        self.send_header("Content-Length", self.file.length or str(total - start))
        if status == 206:
            self.send_header("Content-Range", f"bytes {start}-{total - 1}/{total}")
        self.end_headers()


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(fetching.time, "sleep", lambda seconds: None)


def test_an_interrupted_download_resumes(tmp_path):
    with Server(hang_up_after=PIECE) as server:
        file, sha256 = fetch(server.url, tmp_path)
    assert file.read_bytes() == CONTENT
    assert sha256 == hashlib.sha256(CONTENT).hexdigest()
    assert server.asked == [None, f"bytes={PIECE}-", f"bytes={2 * PIECE}-"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scenes.zip", "scenes.zip.sha256"]


def test_a_partial_download_is_kept(tmp_path, monkeypatch):
    with Server(hang_up_after=PIECE) as server:
        monkeypatch.setattr(server, "content", Broken(CONTENT, PIECE))
        with pytest.raises(InputError, match=r"scenes.zip: download: expected an answer, found"):
            fetch(server.url, tmp_path)
        assert server.asked == [None, *[f"bytes={PIECE}-"] * fetching.TRIES]
        assert not (tmp_path / "scenes.zip").exists()
        server.content, server.hang_up_after, server.asked = CONTENT, None, []
        assert fetch(server.url, tmp_path)[0].read_bytes() == CONTENT
    assert server.asked == [f"bytes={PIECE}-"]


class Broken(bytes):
    """A file of which nothing can be sent from a certain byte on."""

    def __new__(cls, content, end):
        made = super().__new__(cls, content)
        made.end = end
        return made

    def __getitem__(self, where):
        return bytes(self)[where.start : self.end]


def test_a_part_of_an_older_version_is_not_continued(tmp_path, monkeypatch):
    with Server(hang_up_after=PIECE) as server:
        monkeypatch.setattr(server, "content", Broken(CONTENT, PIECE))
        with pytest.raises(InputError):
            fetch(server.url, tmp_path)
        server.content, server.hang_up_after, server.version, server.asked = CONTENT[::-1], None, "two", []
        assert fetch(server.url, tmp_path)[0].read_bytes() == CONTENT[::-1]
    assert server.asked == [None]
    assert not [*tmp_path.glob("*.part")]


def test_an_existing_file_is_not_downloaded_again(tmp_path):
    with Server() as server:
        assert fetch(server.url, tmp_path) == fetch(server.url, tmp_path)
    assert server.asked == [None]


def test_the_digest_of_the_first_download_holds_from_then_on(tmp_path):
    with Server() as server:
        fetch(server.url, tmp_path)
        (tmp_path / "scenes.zip").unlink()
        server.content = CONTENT[::-1]
        expected = hashlib.sha256(CONTENT).hexdigest()
        with pytest.raises(InputError, match=f"sha256: expected {expected}, found another .*scenes.zip.sha256"):
            fetch(server.url, tmp_path)
    assert not (tmp_path / "scenes.zip").exists()


def test_a_file_missing_on_the_server_is_reported_in_one_line(tmp_path):
    with Server() as server, pytest.raises(InputError, match="download: expected an answer, found 404"):
        fetch(server.url.replace("scenes", "others"), tmp_path)


GARDEN = Archive("http://localhost/scenes.zip", "none", {"garden": "images_4"}, folder="set")


def zipped(path, names):
    """A zip file of these entries, each with its name as content; links where a name ends in an arrow."""
    with zipfile.ZipFile(path, "w") as archive:
        for name in names:
            entry = zipfile.ZipInfo(name.removesuffix("->"))
            if name.endswith("->"):
                entry.external_attr = (stat.S_IFLNK | 0o777) << 16
            archive.writestr(entry, name)
    return path


WHOLE = ["set/garden/images_4/a.jpg", "set/garden/images/a.jpg", "set/garden/sparse/0/cameras.bin"]


def test_only_the_photographs_to_compare_on_and_the_cameras_are_unpacked(tmp_path):
    others = ["set/stump/images_4/a.jpg", "garden/images_4/b.jpg", "set/garden/x"]
    file = zipped(tmp_path / "scenes.zip", [*WHOLE, *others])
    extract(file, GARDEN, "garden", tmp_path / "garden", sha256="f00")
    files = {str(path.relative_to(tmp_path / "garden")) for path in (tmp_path / "garden").rglob("*") if path.is_file()}
    assert files == {"images/a.jpg", "sparse/0/cameras.bin", "origin.json"}
    assert (tmp_path / "garden" / "images" / "a.jpg").read_text() == "set/garden/images_4/a.jpg"
    origin = json.loads((tmp_path / "garden" / "origin.json").read_text())
    assert origin == {"url": GARDEN.url, "sha256": "f00", "images": "images_4"}


@pytest.mark.parametrize(
    "entry",
    [
        "set/garden/images_4/../../../../escaped",
        "set/garden/../escaped",
        "set/garden/sparse/..\\escaped",
        "set/garden/images_4/link->",
    ],
)
def test_an_entry_that_leads_out_of_its_folder_is_refused_before_anything_is_written(tmp_path, entry):
    file = zipped(tmp_path / "scenes.zip", [*WHOLE, entry])
    with pytest.raises(InputError, match="expected a file below its folder, found a path or link out of it"):
        extract(file, GARDEN, "garden", tmp_path / "data" / "garden", sha256="f00")
    assert [*tmp_path.iterdir()] == [file]


@pytest.mark.parametrize("missing", ["images_4", "sparse"])
def test_an_archive_without_the_scene_is_refused(tmp_path, missing):
    file = zipped(tmp_path / "scenes.zip", [name for name in WHOLE if missing not in name])
    with pytest.raises(InputError, match="garden: expected photographs in images_4 and sparse, found none"):
        extract(file, GARDEN, "garden", tmp_path / "garden", sha256="f00")


def test_a_corrupt_entry_leaves_nothing_behind(tmp_path):
    file = zipped(tmp_path / "scenes.zip", WHOLE)
    file.write_bytes(file.read_bytes().replace(WHOLE[0].encode() * 2, WHOLE[0].encode() + b"!" * len(WHOLE[0])))
    with pytest.raises(InputError, match="expected a zip archive, found Bad CRC-32"):
        extract(file, GARDEN, "garden", tmp_path / "garden", sha256="f00")
    assert [*tmp_path.iterdir()] == [file]


def test_an_archive_that_unpacks_to_far_more_than_its_size_is_refused_before_anything_is_written(tmp_path):
    file = tmp_path / "scenes.zip"
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in WHOLE:
            archive.writestr(name, bytes(1 << 20))
    with pytest.raises(InputError, match=r"size: expected at most \d+ bytes unpacked, found 2097152 bytes"):
        extract(file, GARDEN, "garden", tmp_path / "garden", sha256="f00")
    assert [*tmp_path.iterdir()] == [file]


@pytest.mark.parametrize(("at", "value"), [((6, 8), 1), ((8, 10), 99)], ids=["encrypted", "unknown compression"])
def test_an_archive_that_cannot_be_unpacked_is_refused_in_one_line(tmp_path, at, value):
    file = zipped(tmp_path / "scenes.zip", WHOLE)
    content = bytearray(file.read_bytes())
    for signature, place in zip((b"PK\3\4", b"PK\1\2"), at, strict=True):
        for header in re.finditer(signature, bytes(content)):
            content[header.start() + place] = value
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"scenes\.zip: file: expected a zip archive, found "):
        extract(file, GARDEN, "garden", tmp_path / "garden", sha256="f00")
    assert [*tmp_path.iterdir()] == [file]


@pytest.mark.parametrize("name", ["\x1b[2J\n.jpg", "a" * 256, "é" * 128])
def test_a_name_that_does_not_print_or_is_too_long_is_refused(tmp_path, name):
    file = zipped(tmp_path / "scenes.zip", [*WHOLE, f"set/garden/images_4/{name}"])
    with pytest.raises(InputError, match="expected printable names of at most 255 bytes"):
        extract(file, GARDEN, "garden", tmp_path / "garden", sha256="f00")


@pytest.mark.parametrize("name", ["set/garden/images_4", "set/garden/sparse/0"])
def test_a_file_where_a_folder_should_be_is_refused(tmp_path, name):
    file = zipped(tmp_path / "scenes.zip", [*WHOLE, name])
    with pytest.raises(InputError, match=f"{name}: expected a folder, found a file of that name"):
        extract(file, GARDEN, "garden", tmp_path / "garden", sha256="f00")


def test_a_folder_that_cannot_be_written_to_is_not_blamed_on_the_archive(tmp_path):
    file = zipped(tmp_path / "scenes.zip", WHOLE)
    (tmp_path / "garden").touch()
    with pytest.raises(FileExistsError, match="garden"):
        extract(file, GARDEN, "garden", tmp_path / "garden", sha256="f00")


@pytest.mark.parametrize("record", [b"", b"\xff\xfe", b"sha256:", b"0123  scenes.zip\n"])
def test_a_corrupt_record_of_a_digest_is_refused(tmp_path, record):
    (tmp_path / "scenes.zip.sha256").write_bytes(record)
    with Server() as server, pytest.raises(InputError, match=r"scenes\.zip\.sha256: file: expected a SHA-256"):
        fetch(server.url, tmp_path)


@pytest.mark.parametrize("length", ["many", "-1"])
def test_a_server_that_names_no_size_is_refused(tmp_path, monkeypatch, length):
    with Server() as server:
        monkeypatch.setattr(server, "length", length)
        with pytest.raises(InputError, match="Content-Length: expected the size of a file, found '"):
            fetch(server.url, tmp_path)


def test_every_scene_is_in_one_archive_outdoors_at_a_quarter_and_indoors_at_a_half():
    sizes = {scene: archive_of(scene).photographs[scene] for scene in SCENES}
    assert sum(len(archive.photographs) for archive in ARCHIVES) == len(sizes) == 10
    assert {scene for scene, size in sizes.items() if size == "images_2"} == {"bonsai", "counter", "kitchen", "room"}
    assert {scene for scene, size in sizes.items() if size == "images"} == {"playroom"}


def test_nothing_is_downloaded_without_consent(tmp_path, capsys):
    assert main(["download", "garden", "playroom", "--out", str(tmp_path)]) == 2
    refusal = capsys.readouterr().err
    assert "--accept-licence: expected your consent, found none" in refusal
    assert all(archive_of(scene).terms in refusal for scene in ("garden", "playroom"))
    assert not [*tmp_path.iterdir()]


def test_an_unknown_scene_is_refused(tmp_path, capsys):
    assert main(["download", "gardn", "--out", str(tmp_path), "--accept-licence"]) == 2
    assert "SCENE: expected one of bicycle, garden" in capsys.readouterr().err


def test_the_command_unpacks_what_it_downloads_and_has_nothing_to_do_a_second_time(tmp_path, monkeypatch):
    content = zipped(tmp_path / "made.zip", [*WHOLE, "set/stump/images_4/a.jpg"]).read_bytes()
    with Server(content) as server:
        made = Archive(server.url, "none", GARDEN.photographs, folder="set")
        monkeypatch.setattr("gspure.cli.download.archive_of", lambda scene: made)
        command = ["download", "garden", "--out", str(tmp_path / "data"), "--accept-licence"]
        assert main(command) == 0
        (tmp_path / "data" / "archives" / "scenes.zip").unlink()
        assert main(command) == 0
    assert server.asked == [None]
    assert (tmp_path / "data" / "garden" / "sparse" / "0" / "cameras.bin").is_file()
