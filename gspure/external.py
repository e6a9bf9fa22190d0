"""Programs of others: how adapters and detectors run them. They are processes of their own and exchange files.

A *command* is a text, a program and its options as in a shell; its *words* are the program and the arguments of the
process. In errors, `source` and `field` name the origin of the command.
"""

from __future__ import annotations

import json
import os
import shlex
import signal
import subprocess
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from gspure.errors import InputError
from gspure.progress import say

_SHOWN = 20  # of the lines that a program prints, and of those of its errors


def words_of(command: str, source: str | Path = "detector") -> list[str]:
    """Return the words of a command, split as a shell does, or raise `InputError`."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise InputError(source, command, expected="a command", found=str(error)) from None
    if not words:
        raise InputError(source, "command", expected="a program and its options", found="nothing")
    return words


def files_of(command: str, source: str | Path = "detector") -> list[str]:
    """Return the files that a command names, as words or as ``--option=FILE``."""
    names: list[str] = []
    for word in words_of(command, source):
        value = word.partition("=")[2]
        names += [word, value]
    return [name for name in names if os.path.isfile(name)]  # noqa: PTH113 -- words may be too long for Path


def output_of(source: str | Path, field: str, words: Sequence[str], timeout: float, folder: Path | None = None) -> str:
    """Return what a program prints, run in a `folder`; if it takes too long, end all that it started.

    Raise `InputError` if it cannot be run, fails or takes more than `timeout` seconds. The last lines of a program that
    fails are shown.
    """
    try:
        status, output, errors = _run(words, timeout, folder)
    except subprocess.TimeoutExpired:
        raise InputError(source, field, expected=f"an answer within {timeout:g} s", found="none") from None
    except OSError as error:
        raise InputError(source, field, expected="a command", found=str(error.strerror)) from None
    if status:
        for line in (*output.splitlines()[-_SHOWN:], *errors.splitlines()[-_SHOWN:]):
            say(f"{field}: {line}")
        reason = _last_line(errors) or f"exit status {status}"
        raise InputError(source, field, expected="success", found=reason)
    return output


def answer_of(
    source: str | Path, field: str, words: Sequence[str], timeout: float, folder: Path | None = None
) -> Mapping[str, Any]:
    """Return the JSON object in the last line of what a program prints.

    Raise `InputError` as `output_of` does, or if the line holds no JSON object.
    """
    line = _last_line(output_of(source, field, words, timeout, folder))
    try:
        answer = json.loads(line)
    except (ValueError, RecursionError):
        answer = None
    if not isinstance(answer, dict):
        raise InputError(source, "output", expected="a JSON object in the last line", found=line or "nothing")
    return answer


def _run(words: Sequence[str], timeout: float, folder: Path | None) -> tuple[int, str, str]:
    """Return exit status, output and errors of a process."""
    streams: dict[str, Any] = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(words, **streams, cwd=folder, start_new_session=True, text=True, errors="replace") as process:
        try:
            output, errors = process.communicate(timeout=timeout)
        except BaseException:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            raise
    return process.returncode, output, errors


def _last_line(text: str) -> str:
    return text.strip().rpartition("\n")[2]
