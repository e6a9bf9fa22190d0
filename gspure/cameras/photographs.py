"""The photographs of views: the names they give, their sizes, missing ones, and the resolution of views."""

import hashlib
import os
import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from itertools import chain, count, islice, takewhile
from pathlib import Path, PurePosixPath
from typing import Final, TypeVar

from gspure.cameras.camera import Camera
from gspure.cameras.entry import Entry
from gspure.errors import InputError
from gspure.images import FORMATS, opened, turn
from gspure.progress import say

Named = TypeVar("Named", Path, Path | None)

TRAINING_RULE: Final = "1600px"  # the default size of training in 3DGS
LONGEST_NAME: Final = 120  # bytes in UTF-8; file systems take 143 or 255, and files of results add to the name
_DIGEST: Final = 16
_PHOTO_SUFFIXES = re.compile(f"( *({'|'.join(map(re.escape, chain(*FORMATS.values())))}))+$", re.IGNORECASE)
_PHOTO_FOLDER = re.compile(r"images(_\d+)?")
_PHOTOS = re.compile(r"(images?|imgs?|photos?|photographs|pictures|rgb|colou?r|input|frames)(_\d+)?", re.IGNORECASE)
_MODEL_FOLDER = re.compile(r"\d+|sparse|colmap|dense|distorted|undistorted|text")  # of COLMAP, inside of a capture
_DEEPEST: Final = 3  # folders below a capture in which its photographs are looked for; ours
_RULE = re.compile(r"native|photographs|1/(?P<factor>[1-9]\d{0,4})|(?P<width>[1-9]\d{0,4})px")


def view_names(entries: Sequence[Entry], key: str, source: Path) -> list[str]:
    """Return the names of views, at least one: the `safe_name` of the file under `key`, not empty, `kept_apart`."""
    if not entries:
        raise InputError(source, "views", expected="at least one", found="none")
    for entry in entries:
        if not safe_name(entry.text(key)):
            raise entry.refusal(key, expected="a file name", found=repr(entry.text(key)))
    files = [entry.text(key) for entry in entries]
    return kept_apart([*map(safe_name, files)], files, source)


def kept_apart(names: list[str], files: Sequence[str], source: Path | str) -> list[str]:
    """Return names, no two equal: one that several `files` share gets what distinguishes these, and a line says so.

    That is the folders that differ, also those up to ``images``; if it is not enough, the suffix, too; or a number.
    """
    names, sharing = [*names], [name for name, views in Counter(names).items() if views > 1]
    taken = {*names} - {*sharing}
    for shared in sharing:
        rows = [row for row, name in enumerate(names) if name == shared]
        paths = [_parts(files[row]) for row in rows]
        levels = zip(*(path[:-1] for path in paths), strict=False)
        common = sum(1 for _ in takewhile(lambda level: len({*level}) == 1, levels))
        folders = ["/".join(part for part in path[common:] if not _PHOTO_FOLDER.fullmatch(part)) for path in paths]
        suffixes = [_PHOTO_SUFFIXES.sub(lambda suffix: suffix[0].replace(".", "_"), path) for path in folders]
        numbers = [*islice((f"{shared}_{i}" for i in count(1) if f"{shared}_{i}" not in taken), len(rows))]
        spellings = ([safe_name(text) for text in texts] for texts in (folders, suffixes, numbers))
        apart = next(spelt for spelt in spellings if len({*spelt}) == len(rows) and taken.isdisjoint(spelt))
        taken.update(apart)
        for row, name in zip(rows, apart, strict=True):
            names[row] = name
    if sharing:
        say(f"{source}: views that share a name are kept apart, such as {apart[0]} and {apart[1]}")
    return names


def safe_name(text: str) -> str:
    """Return the name of the view whose photograph is `text` in a camera file; empty if it has no usable character.

    Photograph suffixes and the folders up to ``images`` (or ``images_4``, ...) are dropped. Other folders are joined to
    the name by ``_``, since the cameras of a rig often have photographs of the same names: ``images/left/0001.jpg``
    becomes ``left_0001``. Outputs are named after views, so a name is one visible component of a path: separators,
    unprintable characters and leading dots are replaced or dropped, and a name longer than `LONGEST_NAME` is cut and
    gets a digest of the whole. A name maps to itself.
    """
    parts = _parts(text)
    within = max((i + 1 for i, part in enumerate(parts[:-1]) if _PHOTO_FOLDER.fullmatch(part)), default=0)
    joined = "_".join(part for part in parts[within:] if part.strip("/."))
    visible = "".join(c if c.isprintable() else "_" for c in joined).lstrip(". ").rstrip(" ")
    name = _PHOTO_SUFFIXES.sub("", visible)
    if len(name.encode()) <= LONGEST_NAME:
        return name
    digest = hashlib.blake2b(name.encode(), digest_size=_DIGEST // 2).hexdigest()
    return f"{name.encode()[: LONGEST_NAME - _DIGEST - 1].decode(errors='ignore')}-{digest}"


def _parts(text: str) -> tuple[str, ...]:
    """Return folders and name of a file, with either kind of slash."""
    return PurePosixPath(unicodedata.normalize("NFC", text).replace("\\", "/")).parts


def located(files: Sequence[str], named: Sequence[Named], place: Path) -> Sequence[Named]:
    """Return the paths `named` of the photographs `files`, or, if these are not all there, those found in the capture.

    `place` is the folder of the camera file. Suffix, letter case and leading folders of photographs may differ; a line
    says where they are.
    """
    there = sum(path is not None and os.path.isfile(path) for path in named)  # noqa: PTH113 - a name may be too long
    if there == len(files):
        return named
    stored = _photographs_near(place.absolute())
    paths = [next((stored[end] for end in _ends(file) if end in stored), None) for file in files]
    existing: list[Path] = [path for path in paths if path]
    if not there < len(existing) == len({*existing}):
        return named
    say(f"{place}: photographs are not where the cameras name them, but in places such as {existing[0]}")
    return [new or old for new, old in zip(paths, named, strict=True)]


def _photographs_near(place: Path) -> dict[str, Path]:
    """Return the photographs of a capture by the ends of their paths, in unusual folders (of masks?) the whole path."""
    above = [place, *place.parents]
    root = next(path for path in above if not _MODEL_FOLDER.fullmatch(path.name))
    stored: dict[tuple[bool, int, Path], list[str]] = {}
    for folder, folders, files in os.walk(root):
        parts = Path(folder).relative_to(root).parts
        usual = any(map(_PHOTOS.fullmatch, parts))
        for path in (Path(folder, file) for file in files if _PHOTO_SUFFIXES.search(file)):
            ends = _ends("/".join([*parts, path.name]))
            beside = [path.stem.casefold()] if Path(folder) == place else []
            stored[not usual, len(parts), path] = beside + (ends if usual else ends[:1])
        folders[:] = folders if len(parts) < _DEEPEST else []
    return {end: row[-1] for row in sorted(stored, reverse=True) for end in stored[row]}


def _ends(file: str) -> list[str]:
    """Return the ends of a path, longest first, without suffix and in lower case."""
    parts = _parts(_PHOTO_SUFFIXES.sub("", file).casefold())
    return ["/".join(parts[i:]) for i in range(len(parts))]


def photograph_size(path: Path) -> tuple[int, int]:
    """Return (width, height) of an image file, from its header."""
    with opened(path) as image:
        return image.size


def photograph(camera: Camera) -> Path:
    """Return the file of a view's photograph, or raise `InputError` if the view names none."""
    if camera.image is None:
        raise InputError(camera.name, "image", expected="a photograph", found="none named")
    return camera.image


def missing_photographs(cameras: Sequence[Camera]) -> list[str]:
    """Return the photographs that do not exist, in the order of views; for a view without photograph, its name."""
    return [str(c.image or f"view {c.name}") for c in cameras if c.image is None or not c.image.is_file()]


def require_present(cameras: Sequence[Camera], source: Path | str, hint: str | None = None) -> None:
    """Require a photograph of every view of `source`, or raise `InputError` with all missing ones."""
    if missing := missing_photographs(cameras):
        found = f"{len(missing)} missing: {', '.join(missing)}"
        raise InputError(source, "photographs", expected=f"one of each of {len(cameras)} views", found=found, hint=hint)


def require_images(cameras: Sequence[Camera], source: Path | str) -> None:
    """Require a photograph of every view of `source`, at least as large as the view, or raise `InputError`."""
    require_present(cameras, source)
    for camera in cameras:
        width, height = photograph_size(photograph(camera))
        if width < camera.width or height < camera.height:
            expected = f"a photograph of at least {camera.width}x{camera.height}"
            hint = turn(photograph(camera)) or "`--resolution photographs` reduces the views to their photographs"
            raise InputError(source, f"{camera.name}.image", expected=expected, found=f"{width}x{height}", hint=hint)


def scaled(cameras: Sequence[Camera], rule: str) -> list[Camera]:
    """Return the cameras at another image size, never enlarged.

    The intrinsics are scaled by the exact ratio of the sizes, so the field of view is unchanged. The rules:

    - ``native``: the file's size;
    - ``1/N``: width and height divided by N and rounded, as 3DGS does for ``-r N`` (a half to the even number);
    - ``Wpx``: wider views become W pixels wide, with their height rounded down; ``1600px`` is 3DGS's default;
    - ``photographs``: the size of each view's photograph, if it is smaller than the view.
    """
    if not (parsed := _RULE.fullmatch(rule)):
        expected = "native, photographs, 1/N or Wpx (such as 1600px)"
        raise InputError("resolution", "value", expected=expected, found=repr(rule))
    factor, most = (int(parsed[name] or 0) for name in ("factor", "width"))

    def size(camera: Camera) -> tuple[int, int]:
        width, height = camera.width, camera.height
        if factor:
            return max(1, round(width / factor)), max(1, round(height / factor))
        if most and width > most:
            return most, max(1, height * most // width)
        if rule == "photographs":
            stored = photograph_size(photograph(camera))
            return min(width, stored[0]), min(height, stored[1])
        return width, height

    return [camera.resized(*size(camera)) for camera in cameras]
