"""Images on disk: 8-bit files to float arrays and back."""

from __future__ import annotations

import logging
import os
import re
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from gspure.artifacts import RENDERED, file_digest, replacing, require_agreement, verify, write_json
from gspure.artifacts.checksums import file_checksum, own_record, read_once, with_checksum
from gspure.constants import LARGEST
from gspure.errors import InputError, reading
from gspure.files import Float32, UInt8
from gspure.progress import warn

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile


FORMATS: Final = {
    "BMP": (".bmp",),
    "GIF": (".gif",),
    "JPEG": (".jpg", ".jpeg"),
    "PNG": (".png",),
    "PPM": (".ppm", ".pgm", ".pbm"),
    "TIFF": (".tif", ".tiff"),
    "WEBP": (".webp",),
}
"""What photographs come in, and their suffixes. Pillow knows more formats, some of which start other programs."""

_SEVERAL: Final = "MPO"  # JPEG files of some cameras, with the photograph first and previews after it
_DEEP: Final = re.compile(";16[BLN]")  # part of the name of 16-bit channels, which Pillow cuts to 8 bits

MOST_PIXELS: Final = 1 << 27  # a compressed file may claim any number of pixels; no camera takes as many; ours

SHOWN: Final = "shown in "  # settings of a table: prefix of the folders of images that it measures, with their origin

_PNG_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
_PNG_HEADER: Final = 16  # byte at which the content of a PNG's first chunk, IHDR, starts
_PNG_CHANNELS: Final = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # by colour type
_ONE_PASS: Final = ((0, 1, 0, 1),)  # first row, step between rows, first column, step between columns
_ADAM7: Final = (
    (0, 8, 0, 8),
    (0, 8, 4, 8),
    (4, 8, 0, 4),
    (0, 4, 2, 4),
    (2, 4, 0, 2),
    (0, 2, 1, 2),
    (1, 2, 0, 1),
)
"""Passes of an interlaced PNG (ISO/IEC 15948, section 8.2)."""

_STDERR: Final = 2

logging.getLogger("PIL").addHandler(logging.NullHandler())  # else its remarks on corrupt files go to standard error


@contextmanager
def opened(path: str | Path) -> Iterator[ImageFile]:
    """Open an image; its pixels are not decoded.

    Raise `InputError` if the file is missing or none of `FORMATS`, differs from its record or that of its folder, has
    more than `MOST_PIXELS`, more than 8 bits per channel or several pictures; or the block fails.
    """
    from PIL import Image

    with reading(path, "an image"):
        verify(Path(path))
        _require_recorded(Path(path))
        with Image.open(str(path), formats=(*FORMATS,)) as image:
            image.verify()  # compares the checksums of a PNG; decoding does not
        with Image.open(str(path), formats=(*FORMATS,)) as image:
            if image.width * image.height > MOST_PIXELS:
                found = f"{image.width}x{image.height}"
                raise InputError(path, "size", expected=f"at most {MOST_PIXELS} pixels", found=found)
            _require_one_picture_of_bytes(path, image)
            yield image


def read_image(
    path: str | Path, size: tuple[int, int] | None = None, background: Sequence[float] | None = (0.0, 0.0, 0.0)
) -> Float32:
    """Read an 8-bit image of one of `FORMATS` as float32 [H,W,3] in 0..1.

    Grey images get three equal channels. Transparent ones are composited on the `levels` of the background; if it is
    None, they keep their alpha, [H,W,4]. An orientation noted in the file's EXIF data is not applied, as camera poses
    belong to the pixels as stored.

    An image larger than `size` (width, height) is reduced by Pillow's antialiased bicubic filter before it becomes
    float, which is what 3DGS compares with; a smaller one is refused, since enlarging invents detail.

    Raise `InputError` if the file is missing, corrupt, not 8-bit, too large, or smaller than `size`.
    """
    from PIL import Image

    with opened(path) as image:
        if image.format == "TIFF":
            _require_all_strips(path, image)
        if image.format == "PNG":
            _require_all_rows(Path(path))
        with _quiet() if image.format == "TIFF" else nullcontext():
            image.load()
        pixels = image.convert("RGBA" if image.has_transparency_data else "RGB")
    if pixels.mode == "RGBA" and background is not None:
        red, green, blue = levels(np.array(background)).tolist()
        behind = Image.new("RGBA", pixels.size, (red, green, blue, 255))
        pixels = Image.alpha_composite(behind, pixels).convert("RGB")
    if size is not None and pixels.size != size:
        if pixels.width < size[0] or pixels.height < size[1]:
            found = f"{pixels.width}x{pixels.height}"
            raise InputError(path, "size", expected=f"at least {size[0]}x{size[1]}", found=found)
        pixels = pixels.resize(size, Image.Resampling.BICUBIC)
    return np.asarray(pixels, np.float32) / np.float32(255)


def write_image(path: str | Path, array: NDArray[np.floating]) -> None:
    """Write the `levels` of an array [H,W,3], or [H,W,4] with alpha, as an 8-bit PNG, whole or not at all."""
    from PIL import Image

    with replacing(Path(path)) as temporary:
        Image.fromarray(levels(array)).save(temporary, format="PNG")


def levels(array: NDArray[np.floating]) -> UInt8:
    """Return values clipped to 0..1 as the nearest of 256 levels, a half upwards."""
    rounded: UInt8 = np.floor(np.clip(array, 0, 1) * 255 + 0.5).astype(np.uint8)
    return rounded


def read_back(array: NDArray[np.floating]) -> Float32:
    """Return an image as it is after `write_image` and `read_image`."""
    return levels(array).astype(np.float32) / np.float32(255)


def require_no_other_images(folder: Path, views: Iterable[str]) -> None:
    """Refuse a folder with PNG files of other views, which would count in every comparison."""
    if others := sorted({path.stem for path in folder.glob("*.png")}.difference(views)):
        found = f"{len(others)}: {others[0]}.png" + ", ..." * (len(others) > 1)
        hint = "name another folder, or delete them"
        raise InputError(folder, "images", expected="none of other views", found=found, hint=hint)


def require_only_png(folder: Path) -> None:
    """Refuse a folder to measure with images of other formats, which would not count."""
    for file in sorted(folder.iterdir()):
        if file.suffix != ".png" and file.suffix.lower() in chain(*FORMATS.values()):
            raise InputError(file, "suffix", expected="only PNG files (.png) in the folder", found=file.suffix)


def mean_colour(image: Float32) -> Float32:
    """Return an image [...,3] with the mean colour in every pixel; an image of one colour stays the same."""
    mean = image.reshape(-1, 3).mean(axis=0, dtype=np.float64)  # float32 would accumulate rounding errors
    return np.broadcast_to(mean.astype(np.float32), image.shape)


def is_blank(image: Float32) -> bool:
    """Return whether an image shows nothing: the standard deviation of each channel is below half a grey level."""
    return bool((levels(image).std(axis=(0, 1)) < 0.5).all())


def is_flat(image: Float32) -> bool:
    """Return whether all pixels of an image [H,W,3] have one colour, and there are several."""
    return image[:, :, 0].size > 1 and bool((image == image[0, 0]).all())


def record_views(
    folder: Path,
    views: Mapping[str, Sequence[float]],
    background: Sequence[float] = (),
    energy: str = "",
    **origin: str,
) -> None:
    """Write the record of a finished folder of images: their sizes and checksums, and their cameras' numbers, if known.

    Renders of a scene also have their background and energy. `origin` is what images show: their `target`, and, of a
    model, its digest (`model`), its `embedding` (`gspure.artifacts.embedding_of`), the `attack` that it comes from,
    the embedding of the `key`, and the digest of the record of the `photographs` that it was trained on.
    """
    names = sorted(views)
    record = {
        "views": {name: [*views[name]] for name in names},
        "bytes": {name: (folder / f"{name}.png").stat().st_size for name in names},
        "crc32": {name: file_checksum(folder / f"{name}.png") for name in names},
        "background": " ".join(f"{round(channel, 4):g}" for channel in background),  # as exact as a model's comment
        "energy": energy,
        **origin,
    }
    write_json(folder / RENDERED, with_checksum(record))


def _recorded(folder: Path) -> Mapping[str, Any]:
    """Return the record of a folder of images; one of no views if it has none."""
    file = folder / RENDERED
    return _read_record(file) if file.is_file() else {"views": {}, "bytes": {}, "crc32": {}}


@read_once
def _read_record(file: Path) -> dict[str, Any]:
    with reading(file, "the views of a finished folder", "record"):
        match record := own_record(file):
            case {"views": dict(views), "bytes": dict(), "crc32": dict(), "background": str(background)}:
                cameras = {view: np.array(numbers, np.float64) for view, numbers in views.items()}
                channels = np.array(background.split(), np.float64)
                is_possible = all(c.ndim == 1 and (abs(c) <= LARGEST).all() for c in cameras.values())
                is_possible &= len(channels) in {0, 3} and bool(((channels >= 0) & (channels <= 1)).all())
                if is_possible:
                    return {**record, "views": cameras}
        raise ValueError("a corrupt record")


def require_all_images(folder: Path) -> None:
    """Refuse a folder that lacks the image of a view in its record, or whose image has another size; none is read.

    Warn of images that the record does not list. A folder without a record passes.
    """
    record = _recorded(folder)
    images = {path.stem: path for path in folder.glob("*.png") if path.is_file()}
    if record["views"] and (others := sorted(images.keys() - record["views"].keys())):
        more = ", ..." * (len(others) > 1)
        warn(f"{folder}: {RENDERED} does not list {len(others)} of {len(images)} images: {others[0]}.png{more}")
    if missing := [view for view in record["views"] if view not in images]:
        found = f"all but {len(missing)}: {missing[0]}.png" + ", ..." * (len(missing) > 1)
        hint = f"render them again; if deleted on purpose, delete {RENDERED} too"
        raise InputError(folder, "images", expected=f"all {len(record['views'])} views", found=found, hint=hint)
    for view in record["views"]:
        size = (path := images[view]).stat().st_size
        if (known := record["bytes"].get(view, size)) != size:
            raise _replaced(path, f"{known} bytes", f"{size} bytes")


def _require_recorded(path: Path) -> None:
    """Refuse an image that differs from the checksum in the record of its folder; without one, it passes."""
    expected = _recorded(path.parent)["crc32"].get(path.stem) if path.suffix == ".png" else None
    if expected and (found := file_checksum(path)) != expected:
        raise _replaced(path, f"CRC-32 {expected}", found)


def _replaced(path: Path, expected: str, found: str) -> InputError:
    hint = f"corrupt or replaced; render it again, or delete {RENDERED} if it was replaced on purpose"
    return InputError(path, "content", expected=f"{expected}, as in {RENDERED}", found=found, hint=hint)


def origin_of(folder: Path, name: str) -> str:
    """Return what images show: an entry of the `origin` of `record_views`; empty if unknown."""
    return str(_recorded(folder).get(name, ""))


def shown_in(folder: Path) -> dict[str, dict[str, str]]:
    """Return a setting of a table that measures a folder of images: what they show, as far as it is known."""
    origin = {name: origin_of(folder, name) for name in ("model", "embedding", "attack", "key")}
    return {f"{SHOWN}{folder.name}": known} if (known := {k: v for k, v in origin.items() if v}) else {}


def photographs_of(folder: Path) -> dict[str, str]:
    """Return which photographs images are, or which they show, if known: the digest of their record, by target."""
    record = _recorded(folder)
    target = str(record.get("target", "")).partition("_")[0]  # all extractions show one message
    photographs = record.get("photographs", "") if record.get("model") else target and file_digest(folder / RENDERED)
    return {target: str(photographs)} if photographs else {}


def with_records(images: Iterable[Path]) -> dict[str, Path]:
    """Return images and the records of their folders by path, as inputs of a table about them."""
    files = {file for image in images for file in (image, image.with_name(RENDERED)) if file.is_file()}
    return {file.as_posix(): file for file in sorted(files)}


def background_of(*folders: Path) -> tuple[float, ...]:
    """Return the background that the record of the first of some folders of images names; black if none does."""
    named = (record["background"] for record in map(_recorded, folders) if record.get("background"))
    return tuple(map(float, next(named, "0 0 0").split()))


def require_comparable(folder: Path, other: Path, views: Iterable[str]) -> None:
    """Refuse images of one view by different cameras, energies or backgrounds, and renders of other targets or scenes.

    What records do not name is not compared.
    """
    record, record_of_other = _recorded(folder), _recorded(other)
    for setting in ("background", "energy"):
        first, second = record.get(setting), record_of_other.get(setting)
        if first and second and first != second:
            hint = f"render both with one --{setting}"
            raise InputError(other, setting, expected=f"{first}, as in {folder}", found=second, hint=hint)
    if record.get("model") or record_of_other.get("model"):  # photographs are compared with any others
        first, second = (origin_of(images, "target").partition("_")[0] for images in (folder, other))
        if first and second and first != second:
            raise InputError(other, "target", expected=f"{first}, as in {folder}", found=second)
        require_agreement(folder, other, photographs_of(folder), photographs_of(other))
    _require_cameras(other, {view: record["views"].get(view, []) for view in views}, f"the camera of {folder}")


def require_photographs(folder: Path, target: str, views: Mapping[str, Sequence[float]]) -> None:
    """Refuse recorded images of another target, or by other cameras than those of these numbers."""
    if (recorded := origin_of(folder, "target")) not in {"", target}:
        raise InputError(folder, "target", expected=target, found=recorded)
    _require_cameras(folder, views, "the given camera")


def _require_cameras(folder: Path, views: Mapping[str, Sequence[float]], expected: str) -> None:
    """Refuse images whose recorded cameras have other numbers than the cameras of the same names."""
    recorded = _recorded(folder)["views"]
    for view, first in views.items():
        second = recorded.get(view, [])
        if len(first) and len(second) and (len(first) != len(second) or not np.allclose(first, second, 1e-6, 1e-6)):
            hint = "use one cameras.json for both"
            raise InputError(folder, view, expected=expected, found="another of this name", hint=hint)


def require_intact(path: Path) -> None:
    """Refuse an image that disagrees with its own checksums, as PNG files have them, or with that in its record."""
    with opened(path):
        pass


def _require_one_picture_of_bytes(path: str | Path, image: ImageFile) -> None:
    """Refuse an image of more than 8 bits per channel, and an animation, of which one picture would count."""
    if image.mode[0] in "IF" or any(_is_deep(tile.codec_name, tile.args) for tile in image.tile):
        raise InputError(path, "pixels", expected="8 bits per channel", found="more")
    if image.format != _SEVERAL and getattr(image, "is_animated", False):
        raise InputError(path, "pictures", expected="one", found="several")


def _is_deep(codec: str, args: object) -> bool:
    """Return whether Pillow cuts what it decodes to 8 bits per channel."""
    match codec, args:
        case "ppm", (_, int(largest)):
            return largest > 255
    return _DEEP.search(str(args)) is not None


def _require_all_strips(path: str | Path, image: ImageFile) -> None:
    """Refuse a TIFF whose strips or tiles end before its last row; Pillow would read the rest as black."""
    size = image.width * image.height
    boxes = (strip.extents or (0, 0, 0, 0) for strip in image.tile)
    stored = sum((right - left) * (lower - upper) for left, upper, right, lower in boxes)
    if stored < size:
        raise InputError(path, "pixels", expected=str(size), found=str(stored))


def _require_all_rows(path: Path) -> None:
    """Refuse a PNG whose pixels end before its last row; Pillow would read the rest as 0."""
    content = path.read_bytes()
    width, height, depth, colour, *_, interlaced = struct.unpack_from(">2I5B", content, _PNG_HEADER)
    bits = depth * _PNG_CHANNELS[colour]
    sides = [(-(-(height - y) // dy), -(-(width - x) // dx)) for y, dy, x, dx in (_ADAM7 if interlaced else _ONE_PASS)]
    stored = sum(rows * (1 + -(-columns * bits // 8)) for rows, columns in sides if columns > 0)
    if (found := sum(map(len, _inflated(content)))) < stored:
        raise InputError(path, "pixels", expected=f"{stored} bytes", found=str(found))


def _inflated(content: bytes) -> Iterator[bytes]:
    """Yield the pixels of a PNG as stored, filtered, a MiB at a time."""
    position, stream = len(_PNG_SIGNATURE), zlib.decompressobj()
    while position < len(content) and not stream.eof:
        length, kind = struct.unpack_from(">I4s", content, position)
        data = content[position + 8 : position + 8 + length] if kind == b"IDAT" else b""
        while data and not stream.eof:
            yield stream.decompress(data, 1 << 20)
            data = stream.unconsumed_tail
        position += length + 12


@contextmanager
def _quiet() -> Iterator[None]:
    """Discard what libtiff prints to standard error about a corrupt file, under a temporary name."""
    kept, null = os.dup(_STDERR), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, _STDERR)
        yield
    finally:
        os.dup2(kept, _STDERR)
        os.close(kept)
        os.close(null)
