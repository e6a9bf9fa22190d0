"""Files over HTTP: continued where they were cut off, and checked against a digest."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final

from gspure.artifacts import digest, remove, write_text
from gspure.errors import InputError, reading
from gspure.progress import say

if TYPE_CHECKING:
    from requests import Response

TRIES: Final = 5  # number of consecutive connections without progress after which a download fails; ours

_SHA256: Final = re.compile(r"([0-9a-fA-F]{64})(?!\S)")
_SIZE: Final = re.compile(r"[0-9]{1,18}")
_TIMEOUT: Final = 30.0
_CHUNK: Final = 1 << 16
_SECONDS_BETWEEN_LINES: Final = 10.0


def fetch(url: str, folder: Path) -> tuple[Path, str]:
    """Download a file into a folder unless it is there, and check it; return its path and SHA-256.

    The digest of the first download is recorded beside the file, as ``NAME.sha256`` in the format of ``sha256sum``, and
    is checked from then on: it detects a file that changes later, not one that was wrong from the start. If you know
    the right digest, write it there first.

    Raise `InputError` if the server does not have the file, the connection breaks repeatedly, or the digest differs. A
    partial download is kept, and the next call resumes it.
    """
    import pooch
    import requests

    name = url.rpartition("/")[2]
    record = folder / f"{name}.sha256"
    known = _recorded(record) if record.is_file() else None
    pooch.get_logger().setLevel("WARNING")
    try:
        file = Path(pooch.retrieve(url, known, fname=name, path=folder, downloader=_download))
    except requests.RequestException as error:
        raise InputError(url, "download", expected="an answer", found=" ".join(str(error).split())) from None
    except InputError:
        raise
    except ValueError:  # pooch has removed the file
        hint = f"if there is a new version and you trust it, remove {record}"
        raise InputError(url, "sha256", expected=str(known), found="another", hint=hint) from None
    if known is None:
        known = pooch.file_hash(str(file))
        write_text(record, f"{known}  {name}\n")
        say(f"no digest of {name} is published; recorded the digest of this download: {known}")
    return file, known


def _recorded(record: Path) -> str:
    """Return the digest in a file of ``sha256sum``."""
    expected = "a SHA-256 and a name"
    with reading(record, expected):
        recorded = _SHA256.match(record.read_text(encoding="utf-8"))
    if recorded is None:
        raise InputError(
            record, "file", expected=expected, found="another text", hint="remove it if you trust the file"
        )
    return recorded[1].lower()


def _download(url: str, output_file: str, _pooch: Any) -> None:
    """Download to a file, and keep partial downloads beside it; pooch's own downloader cannot resume."""
    import requests

    head = requests.head(url, timeout=_TIMEOUT, allow_redirects=True)
    head.raise_for_status()
    length = head.headers.get("Content-Length", "")
    if not _SIZE.fullmatch(length):
        raise InputError(url, "Content-Length", expected="the size of a file", found=repr(length))
    total = int(length)
    version = head.headers.get("ETag") or head.headers.get("Last-Modified") or ""
    name = url.rpartition("/")[2]
    part = Path(output_file).with_name(f"{name}.{digest(version, str(total))}.part")
    remove(*set(part.parent.glob(f"{name}.*.part")) - ({part} if version else set()))  # nothing may be added to these
    part.touch()
    fruitless = 0
    while (size := part.stat().st_size) < total:
        try:
            _append(url, part, version, total)
        except (requests.ConnectionError, requests.Timeout, requests.exceptions.ChunkedEncodingError):
            fruitless = 0 if part.stat().st_size > size else fruitless + 1
            if fruitless == TRIES:
                raise
            time.sleep(fruitless)
    part.replace(output_file)


def _append(url: str, part: Path, version: str, total: int) -> None:
    """Request the missing part of one version of a file; a server with another version sends all of that."""
    import requests

    size = part.stat().st_size
    headers = {"Accept-Encoding": "identity"}
    if size:
        headers |= {"Range": f"bytes={size}-", "If-Range": version}
    with requests.get(url, headers=headers, stream=True, timeout=_TIMEOUT) as response:
        response.raise_for_status()
        continued = response.headers.get("Content-Range", "").startswith(f"bytes {size}-")
        with part.open("ab" if continued else "wb") as stream:
            _copy(response, stream, total)


def _copy(response: Response, stream: BinaryIO, total: int) -> None:
    last = time.monotonic()
    for chunk in response.iter_content(_CHUNK):
        stream.write(chunk)
        if time.monotonic() - last > _SECONDS_BETWEEN_LINES:
            last = time.monotonic()
            say(f"{stream.tell() >> 20} of {total >> 20} MiB downloaded")
