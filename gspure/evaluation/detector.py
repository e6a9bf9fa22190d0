"""Marks read from images: with the key of a scheme that hides bits, or by a command of the user's, the detector."""

import json
import os
import reprlib
import selectors
import shlex
import signal
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import numpy as np

from gspure.artifacts import distinct, file_digest
from gspure.errors import InputError
from gspure.evaluation.detection import LARGEST, Reading, as_bits, share_correct
from gspure.files import Bools, Float32
from gspure.images import read_image, require_all_images, require_intact, require_only_png

LONGEST_LINE: Final = 16 << 20  # bytes that a detector may print in its last line; ours


def read_marks(command: str, images: Path, message: str, timeout: float) -> list[Reading]:
    """Return what a command reads from each PNG file of a folder, within `timeout` seconds.

    The command gets the folder as its last argument. The last line that it prints is a JSON object that maps the name
    of each image, without ``.png``, to bits, as a text of 0 and 1, or to a score, which is high if the mark is present.
    `message` holds the embedded bits, and is empty if the command returns scores.

    Raise `InputError` if the command cannot be run, fails, takes too long, changes an image or prints anything else.
    """
    files = _png_files(images)
    for file in files:
        require_intact(file)
    before = {file: file_digest(file) for file in files}
    views, answer = {file.stem for file in files}, _answer(command, images, timeout)
    for file, digest in before.items():
        if not file.is_file() or file_digest(file) != digest:
            raise InputError(file, "content", expected="the image as before", found="one that the detector changed")
    for view in sorted(views.symmetric_difference(answer)):
        found = "no entry" if view in views else "an entry without an image"
        raise InputError("detector", view, expected="an entry for every image", found=found)
    return [_reading(view, answer[view], message) for view in sorted(views)]


def read_bits(read: Callable[[Float32], Bools], message: Bools, images: Path) -> list[Reading]:
    """Return what a key reads from each PNG file of a folder, compared with the embedded `message`."""
    shown = {path.stem: as_bits(read(read_image(path)), len(message)) for path in _png_files(images)}
    return [Reading(view, share_correct(bits, message), len(message)) for view, bits in shown.items()]


def words_of(command: str) -> list[str]:
    """Return the words of a command, split as a shell does, or raise `InputError`."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise InputError("detector", command, expected="a command", found=str(error)) from None
    if not words:
        raise InputError("detector", "command", expected="a program and its options", found="nothing")
    return words


def files_of(command: str) -> list[str]:
    """Return the files that a command names, as words or as ``--option=FILE``."""
    names = (name for word in words_of(command) for name in (word, word.partition("=")[2]))
    return [name for name in names if os.path.isfile(name)]  # noqa: PTH113 -- words may be too long for Path


def _png_files(folder: Path) -> list[Path]:
    """Return the images of a folder that is complete, by name."""
    require_all_images(folder)
    files = sorted(folder.glob("*.png"))
    if not files:
        raise InputError(folder, "folder", expected="PNG files", found="none")
    require_only_png(folder)
    return files


def _answer(command: str, images: Path, timeout: float) -> Mapping[str, Any]:
    words = [*words_of(command), str(images)]
    try:
        last, reason, status = _run(words, timeout)
    except (TimeoutError, subprocess.TimeoutExpired):
        raise InputError("detector", command, expected=f"an answer within {timeout:g} s", found="none") from None
    except OSError as error:
        raise InputError("detector", command, expected="a command", found=str(error.strerror)) from None
    if status:
        raise InputError("detector", command, expected="success", found=reason or f"exit status {status}")
    try:
        answer = json.loads(last, object_pairs_hook=distinct)
    except (ValueError, RecursionError):
        answer = None
    if not isinstance(answer, dict):
        raise InputError("detector", "output", expected="a JSON object in the last line", found=last or "nothing")
    return answer


def _run(words: Sequence[str], timeout: float) -> tuple[str, str, int]:
    """Return the last lines of a command's output and errors, and its exit status.

    End what the command started, and raise TimeoutError or TimeoutExpired, if it takes too long.
    """
    end = time.monotonic() + timeout
    pipes: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(words, **pipes, start_new_session=True) as process:
        try:
            output, errors = _last_lines((process.stdout, process.stderr), end)
            return output, errors, process.wait(max(0.0, end - time.monotonic()))
        except BaseException:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            raise


def _last_lines(streams: Sequence[Any], end: float) -> list[str]:
    """Return the last line that is not blank of each stream, whose output is not held; wait until the time `end`."""
    tails = {stream: bytearray() for stream in streams}
    with selectors.DefaultSelector() as selector:
        for stream in streams:
            selector.register(stream, selectors.EVENT_READ)
        while selector.get_map():
            ready = selector.select(max(0.0, end - time.monotonic()))
            if not ready:
                raise TimeoutError
            for key, _ in ready:
                chunk, tail = os.read(key.fd, 1 << 16), tails[key.fileobj]
                tail += chunk
                if not chunk:
                    selector.unregister(key.fileobj)
                elif b"\n" in chunk:
                    del tail[: tail.rstrip().rfind(b"\n") + 1]
                if len(tail) > LONGEST_LINE:
                    expected = f"a last line of at most {LONGEST_LINE >> 20} MiB"
                    raise InputError("detector", "output", expected=expected, found="a longer one")
    return [tail.decode(errors="replace").strip() for tail in tails.values()]


def _reading(view: str, value: object, message: str) -> Reading:
    if message:
        if not isinstance(value, str) or len(value) != len(message) or {*value} - {*"01"}:
            raise InputError("detector", view, expected=f"{len(message)} bits as text", found=repr(value))
        decoded, truth = (np.array([*bits]) == "1" for bits in (value, message))
        return Reading(view, share_correct(decoded, truth), len(message))
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
        hint = "if the detector returns bits, set `message` to the embedded bits" if isinstance(value, str) else None
        raise InputError(
            "detector", view, expected=f"a score within ±{LARGEST:g}", found=reprlib.repr(value), hint=hint
        )
    return Reading(view, float(value), 0)
