"""Named values of a camera file, checked as they are read."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Mapping, Sequence
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
        return InputError(self.source, self._field(key), expected=expected, found=found, hint=hint)

    def _field(self, key: str) -> str:
        return f"{self.where}.{key}" if self.where else key

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def value(self, key: str, expected: str, accepts: Callable[[Any], bool]) -> Any:
        """Return the value of a key, which must be there and accepted."""
        if key not in self.values:
            raise self.refusal(key, expected=expected, found="nothing")
        if not accepts(self.values[key]):
            raise self.refusal(key, expected=expected, found=reprlib.repr(self.values[key]))
        return self.values[key]

    def text(self, key: str) -> str:
        """Return a string."""
        return str(self.value(key, "a text", lambda value: isinstance(value, str)))

    def number(self, key: str, default: float | None = None) -> float:
        """Return a finite number, or the default if there is one and no value."""
        if key not in self and default is not None:
            return default
        return float(self.value(key, f"a number within ±{LARGEST:g}", _is_finite))

    def positive(self, key: str) -> float:
        """Return a finite number above zero."""
        expected = f"a positive number up to {LARGEST:g}"
        return float(self.value(key, expected, lambda value: _is_finite(value) and value > 0))

    def pixels(self, key: str) -> int:
        """Return the length of an image's side."""
        return int(self.value(key, f"a whole number of pixels from {SIDE}", _is_side))

    def distortion(self, names: Sequence[str]) -> tuple[float, ...]:
        """Return the coefficients of a lens, 0 where missing; nothing if all are 0. Lists of them are refused."""
        for key in ("distortion", "distortion_params"):
            if key in self:
                self.value(
                    key, f"a key for each of {', '.join(names)}", lambda value: not np.array(value, object).any()
                )
        values = tuple(self.number(name, 0.0) for name in names)
        return values if any(values) else ()

    def array(self, key: str, *shapes: tuple[int, ...]) -> Float64:
        """Return finite numbers nested in one of the given shapes."""

        def is_of_shape(value: Any) -> bool:
            array = np.array(value, dtype=object)
            return array.shape in shapes and all(map(_is_finite, array.flat))

        expected = f"numbers {' or '.join(str(list(shape)) for shape in shapes)} within ±{LARGEST:g}"
        return np.array(self.value(key, expected, is_of_shape), np.float64)

    def rigid(self, key: str, *shapes: tuple[int, ...]) -> Float64:
        """Return a rotation [3,3] or a rigid transform."""
        matrix = self.array(key, *shapes)
        require_rigid(self.source, self._field(key), matrix)
        return matrix


def _is_finite(value: Any) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and -LARGEST <= value <= LARGEST


def _is_side(value: Any) -> bool:
    return _is_finite(value) and value == int(value) and int(value) in SIDE
