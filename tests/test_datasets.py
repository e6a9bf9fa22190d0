"""Downloads that go on where they were cut off, and archives of which only what is needed is unpacked."""

import json
import threading
import zipfile
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

from gspure.cli import main
from gspure.datasets import SCENES, Archive, extract, fetch
from gspure.errors import InputError

CONTENT = np.random.default_rng(0).bytes(300_000)
PIECE = 131_072


@contextmanager
def serving(content=CONTENT, *, hang_up_after=None):
    """Serve one file, and hang up after so many bytes of an answer; yield its URL and the ranges asked for."""
    asked = []

    class Handler(BaseHTTPRequestHandler):
        def log_message(self, *words):
            pass

        def do_HEAD(self):
            self.begin(200, 0)

        def do_GET(self):
            asked.append(self.headers["Range"])
            continued = asked[-1] and self.headers["If-Range"] == '"one"'
            start = int(asked[-1].removeprefix("bytes=").removesuffix("-")) if continued else 0
            self.begin(206 if continued else 200, start)
            self.wfile.write(content[start:][:hang_up_after])

        def begin(self, status, start):
            self.send_response(status)
            self.send_header("ETag", '"one"')
            self.send_header("Content-Length", str(len(content) - start))
            if status == 206:
                self.send_header("Content-Range", f"bytes {start}-{len(content) - 1}/{len(content)}")
            self.end_headers()

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as http:
        thread = threading.Thread(target=http.serve_forever, args=(0.01,), daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{http.server_port}/scenes.zip", asked
        http.shutdown()
        thread.join()


def test_an_interrupted_download_resumes(tmp_path):
    with serving(hang_up_after=PIECE) as (url, asked):
        for _ in range(2):
            with pytest.raises(InputError, match=r"scenes.zip: download: expected an answer, found"):
                fetch(url, tmp_path)
        assert fetch(url, tmp_path).read_bytes() == CONTENT
    assert asked == ["bytes=0-", f"bytes={PIECE}-", f"bytes={2 * PIECE}-"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scenes.zip"]


GARDEN = Archive("http://localhost/scenes.zip", "none", "images_4", folder="set")


def zipped(path, names):
    """A zip file of these entries, each with its name as content."""
    with zipfile.ZipFile(path, "w") as archive:
        for name in names:
            archive.writestr(name, name)
    return path


WHOLE = ["set/garden/images_4/a.jpg", "set/garden/images/a.jpg", "set/garden/sparse/0/cameras.bin"]


def test_only_the_photographs_to_compare_on_and_the_cameras_are_unpacked_and_nothing_outside_the_folder(tmp_path):
    others = ["set/stump/images_4/a.jpg", "garden/images_4/b.jpg", "set/garden/x"]
    others += ["set/garden/images_4/../../../../escaped", "set/garden/sparse/../escaped"]
    extract(zipped(tmp_path / "scenes.zip", [*WHOLE, *others]), GARDEN, "garden", tmp_path / "garden")
    files = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    names = ("images/a.jpg", "images/escaped", "sparse/0/cameras.bin", "sparse/escaped", "provenance.json")
    assert files - {"scenes.zip"} == {f"garden/{name}" for name in names}
    assert (tmp_path / "garden" / "images" / "a.jpg").read_text() == "set/garden/images_4/a.jpg"
    settings = json.loads((tmp_path / "garden" / "provenance.json").read_text())["settings"]
    assert settings == {"url": GARDEN.url, "images": "images_4"}


def test_nothing_is_downloaded_without_consent(tmp_path, capsys):
    assert main(["download", "garden", "playroom", "--out", str(tmp_path)]) == 2
    refusal = capsys.readouterr().err
    assert "--accept-licence: expected your consent, found none" in refusal
    assert all(SCENES[scene].terms in refusal for scene in ("garden", "playroom"))
    assert not [*tmp_path.iterdir()]


def test_the_command_unpacks_what_it_downloads_and_has_nothing_to_do_a_second_time(tmp_path, monkeypatch):
    content = zipped(tmp_path / "made.zip", [*WHOLE, "set/stump/images_4/a.jpg"]).read_bytes()
    with serving(content) as (url, asked):
        monkeypatch.setitem(SCENES, "garden", GARDEN._replace(url=url))
        command = ["download", "garden", "--out", str(tmp_path / "data"), "--accept-licence"]
        assert main(command) == 0
        (tmp_path / "data" / "archives" / "scenes.zip").unlink()
        assert main(command) == 0
    assert asked == ["bytes=0-"]
    assert (tmp_path / "data" / "garden" / "sparse" / "0" / "cameras.bin").is_file()
