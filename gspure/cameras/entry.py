"""Named values of a camera file, checked as they are read."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gspure.arrays import Float64
from gspure.cameras.camera import LENS_COEFFICIENTS, require_rigid
from gspure.constants import LARGEST
from gspure.errors import InputError, printable
from gspure.progress import warn
from gspure.settings import SIDE


@dataclass(frozen=True)
class Entry:
    """One object of a camera file; the constructor and all methods that read raise `InputError` for unsuitable values.

    `place` is that of the object in the `source`, such as ``[3]`` or ``camera 1``; empty for the whole file.
    """

    source: Path | str
    place: str
    values: Any  # the constructor refuses all but mappings

    def __post_init__(self) -> None:
        if not isinstance(self.values, Mapping):
            value = reprlib.repr(self.values)
            raise InputError(self.source, self.place or "file", expected="an object", found=value)

    def refusal(self, key: str, *, expected: str, found: str, hint: str | None = None) -> InputError:
        """Return the error that names one key of this entry."""
        return InputError(self.source, self._field(key), expected=expected, found=found, hint=hint)

    def _field(self, key: str) -> str:
        return f"{self.place}.{key}" if self.place else key

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def value(self, key: str, expected: str, accepts: Callable[[Any], bool]) -> Any:
        """Return the value of a key; refuse a missing one, and one that `accepts` rejects."""
        if key not in self.values:
            raise self.refusal(key, expected=expected, found="nothing")
        if not accepts(self.values[key]):
            raise self.refusal(key, expected=expected, found=reprlib.repr(self.values[key]))
        return self.values[key]

    def text(self, key: str) -> str:
        """Return a string."""
        return str(self.value(key, "a text", lambda value: isinstance(value, str)))

    def number(self, key: str, default: float | None = None) -> float:
        """Return a finite number, or the default, if any, where the key is missing."""
        if key not in self and default is not None:
            return default
        return float(self.value(key, f"a number within ±{LARGEST:g}", _is_finite))

    def positive(self, key: str) -> float:
        """Return a finite number above zero."""
        expected = f"a positive number up to {LARGEST:g}"
        return float(self.value(key, expected, lambda value: _is_finite(value) and value > 0))

    def pixels(self, key: str) -> int:
        """Return the length of an image's side."""
        expected = f"a whole number of pixels from {SIDE}"
        return int(self.value(key, expected, lambda value: _is_finite(value) and value % 1 == 0 and int(value) in SIDE))

    def distortion(self) -> tuple[float, ...]:
        """Return the `LENS_COEFFICIENTS`, 0 where missing; empty if all are 0. Refuse a list of them unless zero."""
        for key in {"distortion", "distortion_params"} & self.values.keys():
            self.value(key, f"a key for each of {', '.join(LENS_COEFFICIENTS)}", lambda value: not np.any(value))
        values = tuple(self.number(name, 0.0) for name in LENS_COEFFICIENTS)
        return values if any(values) else ()

    def array(self, key: str, *shapes: tuple[int, ...]) -> Float64:
        """Return an array of finite numbers in one of these shapes."""

        def is_of_shape(value: Any) -> bool:
            array = np.array(value, dtype=object)
            return array.shape in shapes and all(map(_is_finite, array.flat))

        expected = f"numbers {' or '.join(str(list(shape)) for shape in shapes)} within ±{LARGEST:g}"
        return np.array(self.value(key, expected, is_of_shape), np.float64)

    def has_gaps(self, key: str) -> bool:
        """Return whether a number of an array is NaN or infinite, or written as null, as in strict JSON."""
        values = np.array(self.values.get(key, 0), dtype=object)
        return any(value is None or (isinstance(value, float) and not math.isfinite(value)) for value in values.flat)

    def rigid(self, key: str, *shapes: tuple[int, ...]) -> Float64:
        """Return a rotation [3,3] or a rigid transform."""
        matrix = self.array(key, *shapes)
        require_rigid(self.source, self._field(key), matrix)
        return matrix


def with_finite_poses(entries: Sequence[Entry], name: str, *pose: str) -> list[Entry]:
    """Return the entries without those that have NaN or infinity under a key of their `pose`, with a warning.

    `name` is the key of their photographs. If all poses have, all are returned, and the reader refuses the first.
    """
    finite = [entry for entry in entries if not any(map(entry.has_gaps, pose))]
    if len(finite) in (0, len(entries)):
        return [*entries]
    names = ", ".join(entry.text(name) for entry in entries if entry not in finite)
    counts = f"{len(entries) - len(finite)} of {len(entries)} photographs"
    warn(f"{entries[0].source}: {counts} left out, whose pose is not finite: {printable(names)}")
    return finite


def _is_finite(value: Any) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and -LARGEST <= value <= LARGEST
