"""SOG, versions 1 and 2: numbers of 8 bits in the pixels of WebP images, in an archive or beside their ``meta.json``.

Scales and colours are indices into tables of 256 values (version 2) or scaled to a range (version 1). Positions have
two images, of their lower and upper 8 bits. Spherical harmonics are indices into an image of up to 65 536 entries.
"""

import io
import json
import struct
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from gspure.arrays import UNPACKED_RATIO, UNPACKED_ROOM, Float32, UInt8
from gspure.errors import InputError, reading
from gspure.files import read_bytes
from gspure.model.compressed import from_bytes, quats_of_smallest, require_harmonics, require_room
from gspure.model.gaussians import RENDER_MODE, REST_COEFFICIENTS, Gaussians
from gspure.model.inria import UNPACKED_SOG, sog_chunks
from gspure.progress import warn

Member = Callable[[str], bytes]

_PARTS: Final = ("means", "quats", "scales", "sh0", "shN")
_RENDER_MODES: Final = {"default": "", "antialiased": "mip", "2dgs": "2dgs"}
_PER_ROW: Final = 64  # entries in each row of the image of spherical harmonics
_PALETTE_LIMIT: Final = 1 << 16  # largest number of entries

_RIFF_HEADER: Final = 12  # bytes of a WebP file before its chunks
_CHUNK: Final = struct.Struct("<4sI")  # kind and length; padded to an even number of bytes

_BORDER: Final = 1 << 12  # an image may have this many pixels more than two per Gaussian
_LARGEST_IS_W: Final = 252  # fourth channel of a rotation with largest component w; x, y and z are 253, 254 and 255


def read_sog(path: Path) -> Gaussians:
    """Read a ``.sog`` archive, or the ``meta.json`` of an unpacked one and the images that it names beside it."""
    with reading(path, "a SOG model"):
        if path.name == UNPACKED_SOG:
            return _model(path, partial(_beside, path.parent))
        data = read_bytes(path)
        most = max(UNPACKED_ROOM, UNPACKED_RATIO * len(data))
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return _model(path, partial(_member, archive, most))


def read_streamed(path: Path) -> Gaussians:
    """Read the finest level of a streamed model from its ``lod-meta.json``, an index of chunks, each a SOG model."""
    with reading(path, "a streamed SOG model"):
        index = json.loads(read_bytes(path))
        ranges = [_finest_level(node["lods"]) for node in _nodes(index["tree"])]
        chunks = {number: _chunk(path, index["filenames"][number]) for number in {rows["file"] for rows in ranges}}
        if sum(rows["count"] for rows in ranges) > sum(map(len, chunks.values())):
            raise ValueError("more rows than the chunks hold")
        models = [chunks[rows["file"]][rows["offset"] : rows["offset"] + rows["count"]] for rows in ranges]
        if index.get("environment"):
            models.append(_chunk(path, index["environment"]))
        return _joined(models)


def read_chunks(folder: Path) -> Gaussians:
    """Read the chunks of a folder, `sog_chunks`, as one model."""
    chunks = sog_chunks(folder)
    if len(chunks) > 1:
        warn(f"{folder}: {len(chunks)} SOG chunks are read as one model; to read one of them, name its file")
    return _joined([read_sog(file) for file in chunks])


def _joined(models: Sequence[Gaussians]) -> Gaussians:
    """Return the rows of several models, with the highest of their degrees."""
    degree = max(model.sh_degree for model in models)
    return Gaussians.from_stored(
        means=np.concatenate([model.means for model in models]),
        quats=np.concatenate([model.quats for model in models]),
        log_scales=np.concatenate([model.log_scales for model in models]),
        opacity_logits=np.concatenate([model.table["opacity"] for model in models]),
        sh_coeffs=np.concatenate([model.sh_coeffs_of(degree) for model in models]),
    )


def _finest_level(levels: Mapping[str, Any]) -> Any:
    """Return the range of rows of the level with the lowest number."""
    return min(levels.items(), key=lambda level: int(level[0]))[1]


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
        return read_bytes(folder / name)


def _member(archive: zipfile.ZipFile, most: int, name: str) -> bytes:
    size = archive.getinfo(name).file_size
    if size > most:
        raise ValueError(f"{size} bytes unpacked, at most {most} are read")
    with archive.open(name) as stream:
        return stream.read(size)  # an archive may understate its size


def _model(path: Path, member: Member) -> Gaussians:
    meta = json.loads(member(UNPACKED_SOG))
    version = meta.get("version", 1)
    if version not in (1, 2):
        raise InputError(path, "version", expected="1 or 2", found=str(version), hint="save it as SOG 2 or as .ply")
    mode = _RENDER_MODES["antialiased" if meta.get("antialias") else meta.get("model", "default")]
    rows = meta["count"] if version == 2 else meta["means"]["shape"][0]
    files = {part: [member(name) for name in meta[part]["files"]] for part in _PARTS if part in meta}
    size = sum(len(data) for part in files.values() for data in part)
    require_room(path, size, rows, REST_COEFFICIENTS[-1] if "shN" in meta else 0)

    def pixels(part: str) -> list[UInt8]:
        """Return the pixels [K,4] of each image of a part."""
        images = [_pixels(data, 2 * rows + _BORDER).reshape(-1, 4) for data in files[part]]
        least = min(map(len, images))
        if least < rows:
            raise InputError(path, "count", expected=f"at most {least}, the pixels of {part}", found=str(rows))
        return [image[:rows] for image in images]

    (quats,) = pixels("quats")
    (scales,) = pixels("scales")
    (colours,) = pixels("sh0")
    sh_rest = None
    if "shN" in meta:
        palette = _pixels(files["shN"].pop(0), _PALETTE_LIMIT * REST_COEFFICIENTS[-1])
        degree = require_harmonics(path, palette.shape[1] / _PER_ROW)
        entries = _values(meta["shN"], palette.reshape(-1, REST_COEFFICIENTS[degree], 4)[..., :3])
        low, high = pixels("shN")[0][:, :2].astype(np.intp).T
        sh_rest = entries[: meta["shN"].get("count")][low | high << 8]
    rgba = _values(meta["sh0"], colours)
    means = _means(meta["means"], *pixels("means"))
    log_scales = _values(meta["scales"], scales[:, :3])
    model = from_bytes(means, _quats(quats), log_scales, colours[:, 3], rgba[:, :3], sh_rest)
    if version == 1:
        model = model.with_columns({"opacity": rgba[:, 3]})
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
    start = _RIFF_HEADER
    while start + _CHUNK.size <= len(data):
        kind, length = _CHUNK.unpack_from(data, start)
        if kind == b"VP8 ":
            return True
        start += _CHUNK.size + length + length % 2
    return False


def _values(settings: Any, stored: UInt8) -> Float32:
    """Return the values of bytes, from a table or linearly in the range of each column."""
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
    components = (stored[:, :3] / np.float32(127.5) - 1) / np.float32(np.sqrt(2))
    return quats_of_smallest(components, stored[:, 3].astype(np.intp) - _LARGEST_IS_W)
