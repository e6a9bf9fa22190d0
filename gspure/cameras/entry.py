"""Named values of a camera file, checked as they are read."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gspure.cameras.camera import require_rigid
from gspure.constants import LARGEST
from gspure.errors import InputError
from gspure.files import Float64
from gspure.settings import SIDE


@dataclass(frozen=True)
class Entry:
    """One object of a camera file: every reader method returns a checked value or raises `InputError` naming it.

    `where` is the place of the object in the `source`, such as ``[3]`` or ``camera 1``; empty for the whole file.
    """

    source: Path | str
    where: str
    values: Mapping[str, Any]

    @staticmethod
    def of(source: Path | str, where: str, value: Any) -> Entry:
        """Return `value` as an entry, if it is an object at all."""
        if not isinstance(value, Mapping):
            raise InputError(source, where or "file", expected="an object", found=reprlib.repr(value))
        return Entry(source, where, value)

    def refusal(self, key: str, *, expected: str, found: str, hint: str | None = None) -> InputError:
        """Return the error that names one key of this entry."""
        return InputError(self.source, self.field(key), expected=expected, found=found, hint=hint)

    def field(self, key: str) -> str:
        """Return the name of a key in errors, with its place."""
        return f"{self.where}.{key}" if self.where else key

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def raw(self, key: str, expected: str) -> Any:
        """Return the unchecked value of a key that must be there."""
        if key not in self.values:
            raise self.refusal(key, expected=expected, found="nothing")
        return self.values[key]

    def text(self, key: str) -> str:
        """Return a string."""
        value = self.raw(key, "a text")
        if not isinstance(value, str):
            raise self.refusal(key, expected="a text", found=reprlib.repr(value))
        return value

    def number(self, key: str) -> float:
        """Return a finite number."""
        value = self.raw(key, "a number")
        if not _is_finite(value):
            raise self.refusal(key, expected=f"a number within ±{LARGEST:g}", found=reprlib.repr(value))
        return float(value)

    def distortion(self, names: Sequence[str]) -> tuple[float, ...]:
        """Return the coefficients of a lens, 0 where missing; nothing if all are 0. Lists of them are refused."""
        for key in ("distortion", "distortion_params"):
            if np.array(self.values.get(key, 0), object).any():
                found = reprlib.repr(self.values[key])
                raise self.refusal(key, expected=f"a key for each of {', '.join(names)}", found=found)
        values = tuple(self.number(name) if name in self else 0.0 for name in names)
        return values if any(values) else ()

    def positive(self, key: str) -> float:
        """Return a finite number above zero."""
        value = self.raw(key, "a positive number")
        if not _is_finite(value) or float(value) <= 0:
            raise self.refusal(key, expected=f"a positive number up to {LARGEST:g}", found=reprlib.repr(value))
        return float(value)

    def pixels(self, key: str) -> int:
        """Return the length of an image's side."""
        expected = f"a whole number of pixels from {SIDE}"
        value = self.raw(key, expected)
        if not _is_finite(value) or value != int(value) or int(value) not in SIDE:
            raise self.refusal(key, expected=expected, found=reprlib.repr(value))
        return int(value)

    def array(self, key: str, *shapes: tuple[int, ...]) -> Float64:
        """Return finite numbers nested in one of the given shapes."""
        expected = f"numbers {' or '.join(str(list(shape)) for shape in shapes)} within ±{LARGEST:g}"
        value = self.raw(key, expected)
        array = np.array(value, dtype=object)
        if array.shape not in shapes or not all(map(_is_finite, array.flat)):
            raise self.refusal(key, expected=expected, found=reprlib.repr(value))
        return array.astype(np.float64)

    def rotation(self, key: str, matrix: Float64) -> Float64:
        """Return `matrix`, the value of `key`; raise `InputError` unless it is a rotation or a rigid transform."""
        require_rigid(self.source, self.field(key), matrix)
        return matrix


def _is_finite(value: Any) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and -LARGEST <= value <= LARGEST
