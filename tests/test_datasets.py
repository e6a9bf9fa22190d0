"""Downloads that go on where they were cut off, and archives of which only what is needed is unpacked."""

import json
import threading
import zipfile
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

from gspure.cli import main
from gspure.datasets import SCENES, Archive, extract, fetch
from gspure.errors import InputError

CONTENT = np.random.default_rng(0).bytes(300_000)
PIECE = 131_072


class Server:
    """A web server with one file, that hangs up after so many bytes of an answer."""

    def __init__(self, content=CONTENT, *, hang_up_after=None):
        self.content = content
        self.hang_up_after = hang_up_after
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
        self.begin(200, 0)

    def do_GET(self):
        asked = self.headers["Range"]
        self.file.asked.append(asked)
        continued = asked and self.headers["If-Range"] == '"one"'
        start = int(asked.removeprefix("bytes=").removesuffix("-")) if continued else 0
        self.begin(206 if continued else 200, start)
        self.wfile.write(self.file.content[start:][: self.file.hang_up_after])

    def begin(self, status, start):
        total = len(self.file.content)
        self.send_response(status)
        self.send_header("ETag", '"one"')
        self.send_header("Content-Length", str(total - start))
        if status == 206:
            self.send_header("Content-Range", f"bytes {start}-{total - 1}/{total}")
        self.end_headers()


def test_an_interrupted_download_resumes(tmp_path):
    with Server(hang_up_after=PIECE) as server:
        for _ in range(2):
            with pytest.raises(InputError, match=r"scenes.zip: download: expected an answer, found"):
                fetch(server.url, tmp_path)
        assert fetch(server.url, tmp_path).read_bytes() == CONTENT
    assert server.asked == ["bytes=0-", f"bytes={PIECE}-", f"bytes={2 * PIECE}-"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scenes.zip"]


GARDEN = Archive("http://localhost/scenes.zip", "none", "images_4", folder="set")


def zipped(path, names):
    """A zip file of these entries, each with its name as content."""
    with zipfile.ZipFile(path, "w") as archive:
        for name in names:
            archive.writestr(name, name)
    return path


WHOLE = ["set/garden/images_4/a.jpg", "set/garden/images/a.jpg", "set/garden/sparse/0/cameras.bin"]


def test_only_the_photographs_to_compare_on_and_the_cameras_are_unpacked(tmp_path):
    others = ["set/stump/images_4/a.jpg", "garden/images_4/b.jpg", "set/garden/x"]
    file = zipped(tmp_path / "scenes.zip", [*WHOLE, *others])
    extract(file, GARDEN, "garden", tmp_path / "garden")
    files = {str(path.relative_to(tmp_path / "garden")) for path in (tmp_path / "garden").rglob("*") if path.is_file()}
    assert files == {"images/a.jpg", "sparse/0/cameras.bin", "provenance.json"}
    assert (tmp_path / "garden" / "images" / "a.jpg").read_text() == "set/garden/images_4/a.jpg"
    settings = json.loads((tmp_path / "garden" / "provenance.json").read_text())["settings"]
    assert settings == {"url": GARDEN.url, "images": "images_4"}


@pytest.mark.parametrize("entry", ["set/garden/images_4/../../../../escaped", "set/garden/sparse/../escaped"])
def test_no_entry_leads_out_of_the_folder(tmp_path, entry):
    file = zipped(tmp_path / "scenes.zip", [*WHOLE, entry])
    folder = tmp_path / "data" / "garden"
    extract(file, GARDEN, "garden", folder)
    assert not [p for p in tmp_path.rglob("*") if p.is_file() and p != file and not p.is_relative_to(folder)]


def test_nothing_is_downloaded_without_consent(tmp_path, capsys):
    assert main(["download", "garden", "playroom", "--out", str(tmp_path)]) == 2
    refusal = capsys.readouterr().err
    assert "--accept-licence: expected your consent, found none" in refusal
    assert all(SCENES[scene].terms in refusal for scene in ("garden", "playroom"))
    assert not [*tmp_path.iterdir()]


def test_the_command_unpacks_what_it_downloads_and_has_nothing_to_do_a_second_time(tmp_path, monkeypatch):
    content = zipped(tmp_path / "made.zip", [*WHOLE, "set/stump/images_4/a.jpg"]).read_bytes()
    with Server(content) as server:
        monkeypatch.setitem(SCENES, "garden", GARDEN._replace(url=server.url))
        command = ["download", "garden", "--out", str(tmp_path / "data"), "--accept-licence"]
        assert main(command) == 0
        (tmp_path / "data" / "archives" / "scenes.zip").unlink()
        assert main(command) == 0
    assert server.asked == ["bytes=0-"]
    assert (tmp_path / "data" / "garden" / "sparse" / "0" / "cameras.bin").is_file()
