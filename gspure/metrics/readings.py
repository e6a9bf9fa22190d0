"""Readings: what a detector reads from the renders of a model, or from its file: bits or a score.

The detector is the key of a scheme that hides bits, or a command of the user's.
"""

from __future__ import annotations

import reprlib
import shutil
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

import numpy as np

from gspure.arrays import Bools, Float32
from gspure.errors import InputError
from gspure.external import answer_of, words_of
from gspure.images import png_files, read_image

LARGEST: Final = 1e100  # the largest score; its square is finite
MODEL: Final = "model"  # stands for a view where a file is read


class Reading(NamedTuple):
    """What a detector reads from one view, or from a file."""

    view: str  # or `MODEL`
    level: float  # share of correct bits in percent, or the score
    bits: int  # number of bits; 0 for a score
    decoded: str  # the bits, as a text of 0 and 1; empty for a score
    p: float | None = None  # probability under another key, by rank (`gspure.metrics.sign_ranks`); None if unknown

    @property
    def value(self) -> float:
        """The number of correct bits, or the score."""
        return round(self.level * self.bits / 100) if self.bits else self.level


def read_marks(command: str, source: Path, message: str, timeout: float, folder: Path | None = None) -> list[Reading]:
    """Return what a command reads from a model's file, or from each PNG file of a folder, by `answers`.

    `message` holds the embedded bits, and is empty if the command returns scores.
    """
    answer = answers(command, source, timeout, folder)
    return [reading_of(view, value, message) for view, value in answer.items()]


def answers(command: str, source: Path, timeout: float, folder: Path | None = None) -> dict[str, object]:
    """Return what a command answers for a model's file, or for each PNG file of a folder, sorted by view.

    The command runs in `folder`, for at most `timeout` seconds, and gets a copy of the file, or a folder of copies, as
    its last argument: it may change them. The last line that it prints is a JSON object. It maps the name of each
    image, without ``.png``, or `MODEL`, to bits, as a text of 0 and 1, or to a score, which is high if the mark is
    present.

    Raise `InputError` if the command cannot be run, fails, takes too long or prints anything else.
    """
    is_model = source.is_file()
    files = [source] if is_model else png_files(source)
    views = {MODEL} if is_model else {file.stem for file in files}
    words = words_of(command)
    with TemporaryDirectory(prefix="gspure-") as copies:
        for file in files:
            shutil.copyfile(file, Path(copies, file.name))
        read = str(Path(copies, source.name)) if is_model else copies
        answer = answer_of("detector", command, [*words, read], timeout, folder)
    expected = f'one entry, "{MODEL}"' if is_model else "an entry for every image"
    for view in sorted(views.symmetric_difference(answer)):
        mismatch = "no entry" if view in views else "a further entry"
        raise InputError("detector", view, expected=expected, found=mismatch)
    return {view: answer[view] for view in sorted(views)}


def read_bits(read: Callable[[Float32], Bools], message: Bools, images: Path) -> list[Reading]:
    """Return what a key reads from each PNG file of a folder, compared with the embedded `message`."""
    return [bits_reading(path.stem, read(read_image(path)), message) for path in png_files(images)]


def bits_reading(view: str, read: object, message: Bools) -> Reading:
    """Return the reading of a view, or of `MODEL`, from what a key has read there."""
    bits = as_bits(read, len(message))
    return Reading(view, share_correct(bits, message), len(message), as_digits(bits))


def as_bits(read: object, count: int) -> Bools:
    """Return what a key has read as bits [count]; raise `InputError` if it is anything else."""
    bits = read if isinstance(read, np.ndarray) else np.empty(0, object)
    if bits.shape != (count,) or bits.dtype.kind not in "biu" or not np.isin(bits, (0, 1)).all():
        values = reprlib.repr(bits.tolist())
        actual = f"{bits.dtype} {list(bits.shape)}: {values}" if bits is read else type(read).__name__
        expected = f"an array of {count} bits, 0 or 1 each"
        raise InputError("key", "bits read", expected=expected, found=actual)
    return bits.astype(np.bool_)


def as_digits(bits: Bools) -> str:
    """Return bits [N] as a text of 0 and 1."""
    return "".join("1" if bit else "0" for bit in bits)


def share_correct(decoded: Bools, message: Bools) -> float:
    """Return the share of correct bits in percent."""
    return 100.0 * float(np.mean(decoded == message))


def reading_of(view: str, value: object, message: str) -> Reading:
    """Return the reading of a view from its entry in a command's answer; raise `InputError` for one that is none."""
    if message:
        if not isinstance(value, str) or len(value) != len(message) or {*value} - {*"01"}:
            raise InputError("detector", view, expected=f"{len(message)} bits as text", found=repr(value))
        decoded = np.array([*value]) == "1"
        embedded = np.array([*message]) == "1"
        return Reading(view, share_correct(decoded, embedded), len(message), value)
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
        hint = "if the detector returns bits, set `message` to the embedded bits" if isinstance(value, str) else None
        raise InputError(
            "detector", view, expected=f"a score within ±{LARGEST:g}", found=reprlib.repr(value), hint=hint
        )
    return Reading(view, float(value), 0, "")
