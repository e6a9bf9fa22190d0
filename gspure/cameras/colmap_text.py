"""COLMAP's text files: one record per line, images on two lines, comments after ``#``.

The header counts the records. Readers warn of fewer, since the file may be cut at the end of a line.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gspure.cameras.colmap_records import Lens, Points, Pose, parameter_names
from gspure.errors import InputError, reading
from gspure.progress import warn


def lenses(path: Path) -> list[Lens]:
    """Read cameras.txt."""
    out = []
    for number, line in _lines(path):
        fields = line.split()
        if not fields:
            continue
        if len(fields) < 4:
            raise _refusal(path, number, "CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]", line)
        camera_id, width, height = _integers(path, number, [fields[0], *fields[2:4]])
        names = parameter_names(path, camera_id, fields[1])
        values = _floats(path, number, fields[4:])
        if len(values) != len(names):
            raise _refusal(path, number, f"{len(names)} parameters of {fields[1]}", str(len(values)))
        out.append(Lens(camera_id, width, height, dict(zip(names, values, strict=True))))
    _warn_if_cut(path, len(out))
    return out


def poses(path: Path) -> list[Pose]:
    """Read images.txt; the second line of each image, its 2-D points, is skipped and may be empty."""
    out = []
    lines = _lines(path)
    for number, line in lines:
        if not line:
            continue
        fields = line.split(maxsplit=9)
        if len(fields) < 10:
            raise _refusal(path, number, "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME", line)
        image_id, camera_id = _integers(path, number, [fields[0], fields[8]])
        numbers = _floats(path, number, fields[1:8])
        out.append(Pose(image_id, numbers[:4], numbers[4:], camera_id, fields[9]))
        number, points_2d = next(lines, (number + 1, ""))  # noqa: PLW2901
        if len(points_2d.split()) % 3:
            raise _refusal(path, number, "the image's 2-D points as X Y POINT3D_ID (the line may be empty)", points_2d)
    _warn_if_cut(path, len(out))
    return out


def points(path: Path) -> Points:
    """Read points3D.txt without errors and tracks."""
    rows = [(number, line.split()) for number, line in _lines(path) if line]
    for number, fields in rows:
        if len(fields) < 8:
            raise _refusal(path, number, "POINT3D_ID X Y Z R G B ERROR TRACK[]", " ".join(fields))
    xyz = np.array([_floats(path, number, fields[1:4]) for number, fields in rows]).reshape(-1, 3)
    _warn_if_cut(path, len(rows))
    rgb = np.array([_bytes(path, number, fields[4:7]) for number, fields in rows], np.uint8).reshape(-1, 3)
    return Points(xyz, rgb)


def _warn_if_cut(path: Path, count: int) -> None:
    """Warn if the header counts more records."""
    head = re.search(r"^# Number of (\w+): (\d{1,9})", path.read_text(encoding="utf-8-sig"), re.MULTILINE)
    if head and int(head[2]) > count:
        warn(f"{path} has {count} {head[1]}, but its header counts {head[2]}: it may be truncated")


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield (line number, stripped line) without comments."""
    with reading(path, "UTF-8 text"):
        text = path.read_text(encoding="utf-8-sig")
    lines = ((number, line.strip()) for number, line in enumerate(text.splitlines(), start=1))
    return ((number, line) for number, line in lines if not line.startswith("#"))


def _integers(path: Path, number: int, fields: list[str]) -> list[int]:
    try:
        return [int(field) for field in fields]
    except ValueError:
        raise _refusal(path, number, "whole numbers", " ".join(fields)) from None


def _floats(path: Path, number: int, fields: list[str]) -> tuple[float, ...]:
    try:
        return tuple(float(field) for field in fields)
    except ValueError:
        raise _refusal(path, number, "numbers", " ".join(fields)) from None


def _bytes(path: Path, number: int, fields: list[str]) -> list[int]:
    values = _integers(path, number, fields)
    if not all(0 <= value <= 255 for value in values):
        raise _refusal(path, number, "colours from 0 to 255", " ".join(fields))
    return values


def _refusal(path: Path, number: int, expected: str, found: str) -> InputError:
    return InputError(path, f"line {number}", expected=expected, found=found[:60] or "nothing")
