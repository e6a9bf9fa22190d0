"""SOG, versions 1 and 2: numbers of 8 bits in the pixels of WebP images, in an archive or beside their ``meta.json``.

Scales and colours are indices into tables of 256 values (version 2) or scaled to a range (version 1). Positions have
two images, of their lower and upper 8 bits. Spherical harmonics are indices into an image of up to 65 536 entries.
"""

import io
import json
import struct
import zipfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from gspure.arrays import UNPACKED_RATIO, UNPACKED_ROOM, Float32, UInt8
from gspure.errors import InputError, reading
from gspure.model.compressed import from_bytes, require_room, smallest_three
from gspure.model.gaussians import COEFFICIENTS, RENDER_MODE, Gaussians
from gspure.model.inria import UNPACKED_SOG

Member = Callable[[str], bytes]

_PARTS: Final = ("means", "quats", "scales", "sh0", "shN")
_RENDER_MODES: Final = {"default": "", "antialiased": "mip", "2dgs": "2dgs"}
_PER_ROW: Final = 64  # entries in each row of the image of spherical harmonics

_RIFF_HEADER: Final = 12  # bytes of a WebP file before its chunks
_CHUNK: Final = struct.Struct("<4sI")  # kind and length; padded to an even number of bytes

_MOST_ENTRIES: Final = 1 << 16
_BORDER: Final = 1 << 12  # an image may have this many pixels more than two per Gaussian
_LARGEST_IS_W: Final = 252  # fourth channel of a rotation whose largest component is w; the others stand for x, y, z


def read_sog(path: Path) -> Gaussians:
    """Read a ``.sog`` archive, or the ``meta.json`` of an unpacked one and the images that it names beside it."""
    with reading(path, "a SOG model"):
        if path.name == UNPACKED_SOG:
            return _model(path, partial(_beside, path.parent))
        with zipfile.ZipFile(path) as archive:
            return _model(path, partial(_member, archive, max(UNPACKED_ROOM, UNPACKED_RATIO * path.stat().st_size)))


def read_streamed(path: Path) -> Gaussians:
    """Read the finest level of a streamed model: the ``lod-meta.json`` of chunks, each a SOG model, and all of them."""
    with reading(path, "a streamed SOG model"):
        index = json.loads(path.read_bytes())
        parts = [min(node["lods"].items(), key=lambda lod: int(lod[0]))[1] for node in _nodes(index["tree"])]
        chunks = {number: _chunk(path, index["filenames"][number]) for number in {part["file"] for part in parts}}
        if sum(part["count"] for part in parts) > sum(map(len, chunks.values())):
            raise ValueError("more rows than the chunks hold")
        rows = [chunks[part["file"]][part["offset"] : part["offset"] + part["count"]] for part in parts]
        rows += [_chunk(path, index["environment"])] if index.get("environment") else []
        degree = max(part.sh_degree for part in rows)
        columns = [(p.means, p.quats, p.log_scales, p.table["opacity"], p.sh_coeffs_of(degree)) for p in rows]
        names = ("means", "quats", "log_scales", "opacity_logits", "sh_coeffs")
        return Gaussians.from_stored(**dict(zip(names, map(np.concatenate, zip(*columns, strict=True)), strict=True)))


def _nodes(node: Any) -> Iterator[Any]:
    """Yield the nodes of a tree that have rows."""
    if node.get("lods"):
        yield node
    for child in node.get("children") or ():
        yield from _nodes(child)


def _chunk(index: Path, name: str) -> Gaussians:
    if Path(name).is_absolute() or ".." in Path(name).parts:
        raise ValueError(f"a file elsewhere, {name}")
    return read_sog(index.parent / name)


def _beside(folder: Path, name: str) -> bytes:
    if Path(name).name != name:
        raise ValueError(f"a file elsewhere, {name}")
    with reading(folder / name, "a file of a SOG model"):
        return (folder / name).read_bytes()


def _member(archive: zipfile.ZipFile, most: int, name: str) -> bytes:
    if (size := archive.getinfo(name).file_size) > most:
        raise ValueError(f"{size} bytes unpacked, at most {most} are read")
    with archive.open(name) as stream:
        return stream.read(size)  # an archive may understate its size


def _model(path: Path, member: Member) -> Gaussians:
    meta = json.loads(member(UNPACKED_SOG))
    if (version := meta.get("version", 1)) not in (1, 2):
        raise InputError(path, "version", expected="1 or 2", found=str(version))
    mode = _RENDER_MODES["antialiased" if meta.get("antialias") else meta.get("model", "default")]
    rows = meta["count"] if version == 2 else meta["means"]["shape"][0]
    files = {part: [member(name) for name in meta[part]["files"]] for part in _PARTS if part in meta}
    size = sum(len(data) for part in files.values() for data in part)
    require_room(path, size, rows, COEFFICIENTS[-1] if "shN" in meta else 0)

    def pixels(part: str) -> list[UInt8]:
        """Return the first pixel of each row in the images of a part."""
        images = [_pixels(data, 2 * rows + _BORDER).reshape(-1, 4) for data in files[part]]
        if (least := min(map(len, images))) < rows:
            raise InputError(path, "count", expected=f"at most {least}, the pixels of {part}", found=str(rows))
        return [image[:rows] for image in images]

    (quats,), (scales,), (colours,) = pixels("quats"), pixels("scales"), pixels("sh0")
    sh = None
    if "shN" in meta:
        image = _pixels(files["shN"].pop(0), _MOST_ENTRIES * COEFFICIENTS[-1])
        degree = COEFFICIENTS.index(image.shape[1] // _PER_ROW)
        entries = _values(meta["shN"], image.reshape(-1, COEFFICIENTS[degree], 4)[..., :3])
        low, high = pixels("shN")[0][:, :2].astype(np.intp).T
        sh = entries[: meta["shN"].get("count")][low | high << 8]
    rgba = _values(meta["sh0"], colours)
    means, log_scales = _means(meta["means"], *pixels("means")), _values(meta["scales"], scales[:, :3])
    model = from_bytes(means, _quats(quats), log_scales, colours[:, 3], rgba[:, :3], sh)
    model = model.with_columns({"opacity": rgba[:, 3]}) if version == 1 else model
    return model.with_comment(RENDER_MODE + mode) if mode else model


def _pixels(data: bytes, most: int) -> UInt8:
    """Return an image [H,W,4]."""
    from PIL import Image

    if _is_lossy(data):
        raise ValueError("a lossy image, whose numbers are others than those that were stored")
    with Image.open(io.BytesIO(data), formats=("WEBP",)) as image:
        if image.width * image.height > most:
            raise ValueError(f"an image of {image.width}x{image.height}, with more than {most} pixels")
        return np.asarray(image.convert("RGBA"))


def _is_lossy(data: bytes) -> bool:
    """Return whether a WebP file has a chunk of lossy pixels."""
    at = _RIFF_HEADER
    while at + _CHUNK.size <= len(data):
        kind, length = _CHUNK.unpack_from(data, at)
        if kind == b"VP8 ":
            return True
        at += _CHUNK.size + length + length % 2
    return False


def _values(settings: Any, stored: UInt8) -> Float32:
    """Return the values that bytes stand for, from a table or linearly in the range of each column."""
    if "codebook" in settings:
        return np.asarray(settings["codebook"], np.float32)[stored]
    least, largest = (np.asarray(settings[name], np.float32) for name in ("mins", "maxs"))
    return np.asarray(least + (largest - least) * (stored / np.float32(255)), np.float32)


def _means(settings: Any, low: UInt8, high: UInt8) -> Float32:
    """Return positions x, stored as sign(x) log(1 + |x|)."""
    least, largest = (np.asarray(settings[name], np.float64) for name in ("mins", "maxs"))
    stored = low[:, :3].astype(np.uint16) | high[:, :3].astype(np.uint16) << 8
    logs = least + (largest - least) * (stored / 65535)
    return np.asarray(np.sign(logs) * np.expm1(np.abs(logs)), np.float32)


def _quats(stored: UInt8) -> Float32:
    if (stored[:, 3] < _LARGEST_IS_W).any() or (len(stored) > 1 and (stored[:, 3] == 255).all()):  # as without alpha
        raise ValueError("rotations without their largest component")
    three = (stored[:, :3] / np.float32(127.5) - 1) / np.float32(np.sqrt(2))
    return smallest_three(three, stored[:, 3].astype(np.intp) - _LARGEST_IS_W)
