"""Images on disk: 8-bit files to float arrays and back."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from gspure.arrays import Float32, UInt8
from gspure.errors import InputError, reading
from gspure.files import replacing

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
"""Formats of photographs, and their suffixes. Pillow knows more formats, some of which start other programs."""

SUFFIXES: Final = frozenset(suffix for suffixes in FORMATS.values() for suffix in suffixes)

_DEEP: Final = re.compile(";16[BLN]")  # in Pillow's name of 16-bit channels, which it cuts to 8 bits

MOST_PIXELS: Final = 1 << 27  # a compressed file may claim any number of pixels; no camera takes so many

logging.getLogger("PIL").addHandler(logging.NullHandler())  # else its remarks on corrupt files go to standard error

_RAW: Final = (".3fr", ".arw", ".cr2", ".cr3", ".dng", ".nef", ".orf", ".pef", ".raf", ".rw2", ".srw")
_UNREAD: Final = {
    "HEIC": rb"....ftyp(hei|hev|mif1|msf1)",
    "AVIF": rb"....ftypavi",
    "JPEG XL": rb"\xff\x0a|\0\0\0\x0cJXL ",
    "JPEG 2000": rb"\xff\x4f\xff\x51|\0\0\0\x0cjP  ",
    "OpenEXR": rb"\x76\x2f\x31\x01",
    "Radiance HDR": rb"#\?RADIANCE",
    "Photoshop": rb"8BPS",
}
"""Unsupported formats by their first bytes; `_RAW` lists suffixes, since most raw photographs look like TIFF."""

_ORIENTATION: Final = 0x0112  # tag of EXIF: 1 if the pixels are stored upright
_NOT_APPLIED: Final = "ignored, as by COLMAP and 3DGS; `mogrify -auto-orient` applies it"


@contextmanager
def opened(path: str | Path) -> Iterator[ImageFile]:
    """Open the first image of a file, without decoding its pixels.

    Raise `InputError` if the file is missing, is none of `FORMATS`, or has more than `MOST_PIXELS` or more than 8 bits
    per channel; also if the block fails.
    """
    from PIL import Image

    with reading(path, "an image"):
        _refuse_unread(Path(path))
        with Image.open(str(path), formats=(*FORMATS,)) as image:
            image.verify()  # compares the checksums of a PNG; decoding does not
        with Image.open(str(path), formats=(*FORMATS,)) as image:
            if image.width * image.height > MOST_PIXELS:
                actual = f"{image.width}x{image.height}"
                raise InputError(path, "size", expected=f"at most {MOST_PIXELS} pixels", found=actual)
            if image.mode[0] in "IF" or any(_is_deep(tile.codec_name, tile.args) for tile in image.tile):
                raise InputError(path, "pixels", expected="8 bits per channel", found="more")
            yield image


def read_image(
    path: str | Path, size: tuple[int, int] | None = None, background: Sequence[float] | None = (0.0, 0.0, 0.0)
) -> Float32:
    """Read an 8-bit image of one of `FORMATS` as float32 [H,W,3] in 0..1.

    Transparent images are composited on the `levels` of the background; if it is None, they keep their alpha, [H,W,4].
    EXIF orientation is not applied, since camera poses belong to the pixels as stored; but Pillow applies that of TIFF
    files. An image larger than `size` (width, height) is reduced by Pillow's antialiased bicubic filter before it
    becomes float, as in 3DGS.

    Raise `InputError` if the file is missing, corrupt, not 8-bit, too large, or smaller than `size`.
    """
    from PIL import Image

    with opened(path) as image:
        pixels = image.convert("RGBA" if image.has_transparency_data else "RGB")
    if pixels.mode == "RGBA" and background is not None:
        red, green, blue = levels(np.array(background)).tolist()
        behind = Image.new("RGBA", pixels.size, (red, green, blue, 255))
        pixels = Image.alpha_composite(behind, pixels).convert("RGB")
    if size is not None and pixels.size != size:
        width, height = size
        if pixels.width < width or pixels.height < height:
            actual = f"{pixels.width}x{pixels.height}"
            hint = orientation_remark(Path(path))
            raise InputError(path, "size", expected=f"at least {width}x{height}", found=actual, hint=hint)
        pixels = pixels.resize(size, Image.Resampling.BICUBIC)
    return np.asarray(pixels, np.float32) / np.float32(255)


def shrunk(image: Float32, size: tuple[int, int]) -> Float32:
    """Return an image [H,W,C] at a smaller `size` (width, height); each pixel is the mean of those in its area."""
    from PIL import Image

    planes = (Image.fromarray(image[..., channel]) for channel in range(image.shape[2]))
    return np.stack([np.asarray(plane.resize(size, Image.Resampling.BOX)) for plane in planes], axis=-1)


def write_image(path: str | Path, array: NDArray[np.floating]) -> None:
    """Write the `levels` of an array [H,W,3], or [H,W,4] with alpha, as an 8-bit PNG, whole or not at all."""
    from PIL import Image

    with replacing(Path(path)) as temporary:  # level 4 takes half the time of 6, and files are 4 % larger
        Image.fromarray(levels(array)).save(temporary, format="PNG", compress_level=4)


def png_files(folder: Path) -> list[Path]:
    """Return the PNG files of a folder, sorted; raise `InputError` if there is none."""
    files = sorted(file for file in folder.glob("*") if file.suffix.lower() == ".png")
    if not files:
        raise InputError(folder, "folder", expected="PNG files", found="none")
    return files


def levels(array: NDArray[np.floating]) -> UInt8:
    """Return values clipped to 0..1 as the nearest of 256 levels, a half upwards."""
    return np.asarray(np.floor(np.clip(array, 0, 1) * 255 + 0.5), np.uint8)


def read_back(array: NDArray[np.floating]) -> Float32:
    """Return an image as `read_image` returns it after `write_image`."""
    return levels(array).astype(np.float32) / np.float32(255)


def mean_colour(image: Float32) -> Float32:
    """Return an image [...,3] with the mean colour in every pixel; an image of one colour stays the same."""
    mean = image.reshape(-1, 3).mean(axis=0, dtype=np.float64)  # float32 would accumulate rounding errors
    return np.broadcast_to(mean.astype(np.float32), image.shape)


def is_blank(image: Float32) -> bool:
    """Return whether an image shows nothing: the standard deviation of each channel is below half a grey level."""
    return bool((levels(image).std(axis=(0, 1)) < 0.5).all())


def is_flat(image: Float32) -> bool:
    """Return whether an image [H,W,3] has several pixels, all of the same colour."""
    return image[:, :, 0].size > 1 and bool((image == image[0, 0]).all())


def orientation_remark(path: Path) -> str | None:
    """Return a remark on the EXIF orientation of an image; None if it is upright.

    PNG files are not checked: they seldom have an orientation, and it may follow the pixels. Pillow applies that of
    TIFF files.
    """
    from PIL import Image

    with reading(path, "an image"), Image.open(str(path), formats=(*FORMATS,)) as image:
        orientation = 1 if image.format == "PNG" else image.getexif().get(_ORIENTATION, 1)
        treatment = "applied, as by 3DGS; COLMAP ignores it" if image.format == "TIFF" else _NOT_APPLIED
    return None if orientation in (0, 1) else f"EXIF orientation {orientation} is {treatment}"


def _refuse_unread(path: Path) -> None:
    """Refuse a known format that is not read."""
    with path.open("rb") as stream:
        head = stream.read(64)
    matching = (name for name, beginning in _UNREAD.items() if re.match(beginning, head, re.DOTALL))
    kind = "a raw photograph" if path.suffix.lower() in _RAW else next(matching, None)
    if kind:
        raise InputError(path, "format", expected=", ".join(FORMATS), found=kind, hint="convert it to PNG or JPEG")


def _is_deep(codec: str, args: object) -> bool:
    """Return whether a codec decodes channels of more than 8 bits, which Pillow cuts to 8."""
    match codec, args:
        case "ppm", (_, int(largest)):
            return largest > 255
    return _DEEP.search(str(args)) is not None
