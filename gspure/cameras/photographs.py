"""The photographs of views: view names from their files, their sizes, missing ones, and the resolution of views."""

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
from gspure.images import FORMATS, opened, orientation_remark
from gspure.progress import say

PhotoPath = TypeVar("PhotoPath", Path, Path | None)

TRAINING_RULE: Final = "1600px"  # the default size of training in 3DGS
LONGEST_NAME: Final = 120  # bytes in UTF-8; file systems admit 143 or 255, and output files add to the name
_DIGEST: Final = 16
_PHOTO_SUFFIXES = re.compile(f"( *({'|'.join(map(re.escape, chain(*FORMATS.values())))}))+$", re.IGNORECASE)
_PHOTO_FOLDER = re.compile(r"images(_\d+)?")
_PHOTOS = re.compile(r"(images?|imgs?|photos?|photographs|pictures|rgb|colou?r|input|frames)(_\d+)?", re.IGNORECASE)
_MODEL_FOLDER = re.compile(r"\d+|sparse|colmap|dense|distorted|undistorted|text")  # of COLMAP, inside a capture
_DEEPEST: Final = 3  # levels of folders below a capture that are searched for its photographs; ours
_RULE = re.compile(r"native|photographs|1/(?P<factor>[1-9]\d{0,4})|(?P<width>[1-9]\d{0,4})px")


def view_names(entries: Sequence[Entry], key: str, source: Path) -> list[str]:
    """Return distinct names of at least one view, from the file name under `key` (`safe_name`)."""
    if not entries:
        raise InputError(source, "views", expected="at least one", found="none")
    for entry in entries:
        if not safe_name(entry.text(key)):
            raise entry.refusal(key, expected="a file name", found=repr(entry.text(key)))
    files = [entry.text(key) for entry in entries]
    return disambiguated_names([*map(safe_name, files)], files, source)


def disambiguated_names(names: Sequence[str], files: Sequence[str], source: Path | str) -> list[str]:
    """Return distinct names of `files`: those that share a name get others, with a message."""
    distinct = [*names]
    shared_names = [name for name, views in Counter(names).items() if views > 1]
    taken = {*names} - {*shared_names}
    for shared in shared_names:
        rows = [row for row, name in enumerate(distinct) if name == shared]
        new_names = _distinguished(shared, [files[row] for row in rows], taken)
        taken.update(new_names)
        for row, name in zip(rows, new_names, strict=True):
            distinct[row] = name
    if shared_names:
        say(f"{source}: views that share a name are kept apart, such as {new_names[0]} and {new_names[1]}")
    return distinct


def _distinguished(shared: str, files: Sequence[str], taken: set[str]) -> list[str]:
    """Return distinct names of files that share one, none of them `taken`.

    The first of these that suffices distinguishes them: their different folders, also those up to ``images``; these and
    the suffix; a number.
    """
    paths = [_parts(file) for file in files]
    levels = zip(*(path[:-1] for path in paths), strict=False)
    common = sum(1 for _ in takewhile(lambda level: len({*level}) == 1, levels))
    with_folders = ["/".join(part for part in path[common:] if not _PHOTO_FOLDER.fullmatch(part)) for path in paths]
    with_suffixes = [_PHOTO_SUFFIXES.sub(lambda suffix: suffix[0].replace(".", "_"), path) for path in with_folders]
    for texts in (with_folders, with_suffixes):
        names = [safe_name(text) for text in texts]
        if len({*names}) == len(files) and taken.isdisjoint(names):
            return names
    numbered = (f"{shared}_{i}" for i in count(1))
    free = (text for text in numbered if text not in taken)
    return [safe_name(text) for text in islice(free, len(files))]


def safe_name(text: str) -> str:
    """Return the name of the view with the photograph `text` in a camera file; empty if no character is usable.

    Photograph suffixes and the folders up to ``images`` (or ``images_4``, ...) are dropped. Other folders are joined to
    the name by ``_``, since the cameras of a rig often give their photographs the same names: ``images/left/0001.jpg``
    becomes ``left_0001``. Outputs are named after views, so a name is one visible component of a path: separators,
    unprintable characters and leading dots are replaced or dropped, and a name longer than `LONGEST_NAME` is cut and
    gets a digest of the whole. A name of a view maps to itself.
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


def located(files: Sequence[str], expected: Sequence[PhotoPath], place: Path) -> Sequence[PhotoPath]:
    """Return the paths of photographs: those `expected`, or, if some do not exist and more do elsewhere, the latter.

    `files` are the photographs as the camera file names them, `place` is its folder. Suffix, letter case and leading
    folders of photographs in the capture may differ; a message names their place.
    """
    present = sum(path is not None and os.path.isfile(path) for path in expected)  # noqa: PTH113 - a name may be too long
    if present == len(files):
        return expected
    stored = _photographs_near(place.absolute())
    matches = [next((stored[end] for end in _ends(file) if end in stored), None) for file in files]
    existing: list[Path] = [path for path in matches if path]
    if len(existing) <= present or len(existing) != len({*existing}):
        return expected
    say(f"{place}: photographs are not where the cameras name them, but in places such as {existing[0]}")
    return [match or path for match, path in zip(matches, expected, strict=True)]


def _photographs_near(place: Path) -> dict[str, Path]:
    """Return the photographs of a capture by each end of their path; in unusual folders, perhaps of masks, by the path.

    Photographs in usual folders, and then those in the fewest folders, have priority.
    """
    above = [place, *place.parents]
    root = next(path for path in above if not _MODEL_FOLDER.fullmatch(path.name))
    ends_by_photograph: dict[tuple[bool, int, Path], list[str]] = {}
    for folder, subfolders, files in os.walk(root):
        parts = Path(folder).relative_to(root).parts
        is_usual = any(map(_PHOTOS.fullmatch, parts))
        for path in (Path(folder, file) for file in files if _PHOTO_SUFFIXES.search(file)):
            ends = _ends("/".join([*parts, path.name]))
            if not is_usual:
                ends = ends[:1]
            if Path(folder) == place:
                ends = [path.stem.casefold(), *ends]
            ends_by_photograph[not is_usual, len(parts), path] = ends
        if len(parts) >= _DEEPEST:
            subfolders.clear()
    stored = {}
    for photograph_key in sorted(ends_by_photograph, reverse=True):  # the last one counts
        for end in ends_by_photograph[photograph_key]:
            stored[end] = photograph_key[-1]
    return stored


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
    missing = missing_photographs(cameras)
    if missing:
        expected = f"one of each of {len(cameras)} views"
        names = f"{len(missing)} missing: {', '.join(missing)}"
        raise InputError(source, "photographs", expected=expected, found=names, hint=hint)


def require_images(cameras: Sequence[Camera], source: Path | str) -> None:
    """Require a photograph of every view of `source`, at least as large as the view, or raise `InputError`."""
    require_present(cameras, source)
    for camera in cameras:
        width, height = photograph_size(photograph(camera))
        if width < camera.width or height < camera.height:
            expected = f"a photograph of at least {camera.width}x{camera.height}"
            remedy = "`--resolution photographs` reduces the views to their photographs"
            hint = orientation_remark(photograph(camera)) or remedy
            raise InputError(source, f"{camera.name}.image", expected=expected, found=f"{width}x{height}", hint=hint)


def scaled(cameras: Sequence[Camera], rule: str) -> list[Camera]:
    """Return the cameras at the image size of a rule, never enlarged.

    The intrinsics are scaled by the exact ratio of the sizes, so the field of view is unchanged. The rules:

    - ``native``: the file's size;
    - ``1/N``: width and height divided by N and rounded, as 3DGS does for ``-r N`` (a half to the even number);
    - ``Wpx``: wider views become W pixels wide, with their height rounded down; ``1600px`` is 3DGS's default;
    - ``photographs``: the size of each view's photograph, if it is smaller than the view.
    """
    parsed = _RULE.fullmatch(rule)
    if not parsed:
        expected = "native, photographs, 1/N or Wpx (such as 1600px)"
        raise InputError("resolution", "value", expected=expected, found=repr(rule))
    factor = int(parsed["factor"] or 0)
    most = int(parsed["width"] or 0)

    def size(camera: Camera) -> tuple[int, int]:
        if factor:
            return max(1, round(camera.width / factor)), max(1, round(camera.height / factor))
        if most and camera.width > most:
            return most, max(1, camera.height * most // camera.width)
        if rule == "photographs":
            width, height = photograph_size(photograph(camera))
            return min(camera.width, width), min(camera.height, height)
        return camera.width, camera.height

    return [camera.resized(*size(camera)) for camera in cameras]
