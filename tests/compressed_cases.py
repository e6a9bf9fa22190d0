"""Models in compressed formats: files of splat-transform 2.7.1, and writers of other formats.

All hold `blobs(12, sh_degree=2)`, the files in `SPLAT_TRANSFORM` in another order.
"""

import gzip
import io
import json
import struct
import zipfile
from pathlib import Path

import numpy as np
from PIL import Image

from gspure.constants import SH_DC
from gspure.model import Gaussians
from tests.models import blobs

SPLAT_TRANSFORM = Path(__file__).with_name("splat_transform")
ROWS = 12


def model() -> Gaussians:
    return blobs(ROWS, sh_degree=2)


def unit_quats(gaussians: Gaussians) -> np.ndarray:
    """Quaternions (w, x, y, z) whose w is not negative."""
    quats = gaussians.quats
    signs = np.where(quats[:, :1] < 0, -1, 1)
    return quats / np.linalg.norm(quats, axis=1, keepdims=True) * signs


def to_bytes(values) -> np.ndarray:
    return np.clip(np.round(values), 0, 255).astype(np.uint8)


def rgba(gaussians: Gaussians) -> np.ndarray:
    return to_bytes(255 * np.column_stack([0.5 + SH_DC * gaussians.sh_coeffs[:, 0], gaussians.opacities]))


def splat(gaussians: Gaussians) -> bytes:
    rows = np.empty(len(gaussians), [("mean", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("quat", "u1", 4)])
    rows["mean"] = gaussians.means
    rows["scale"] = gaussians.scales
    rows["rgba"] = rgba(gaussians)
    rows["quat"] = to_bytes(unit_quats(gaussians) * 128 + 128)
    return rows.tobytes()


def spz_of_version_2(gaussians: Gaussians) -> bytes:
    turned = gaussians.means * [1, -1, -1]
    fixed = np.round(turned * 4096).astype("<i4").reshape(-1, 3, 1).view(np.uint8)[..., :3]
    signs = np.array([-1, -1, 1, -1, 1, 1, -1, 1])[:, None]
    streams = [
        fixed,
        to_bytes(255 * gaussians.opacities),
        to_bytes(255 * (0.15 * gaussians.sh_coeffs[:, 0] + 0.5)),
        to_bytes((np.log(gaussians.scales) + 10) * 16),
        to_bytes(127.5 * (unit_quats(gaussians)[:, 1:] * [1, -1, -1] + 1)),
        to_bytes(gaussians.sh_coeffs[:, 1:] * signs * 128 + 128),
    ]
    head = struct.pack("<4sIIBBBB", b"NGSP", 2, len(gaussians), 2, 12, 0, 0)
    return gzip.compress(head + b"".join(np.ascontiguousarray(stream).tobytes() for stream in streams))


def webp(pixels: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "WEBP", lossless=True, exact=True)
    return stream.getvalue()


def sog_of_version_1(gaussians: Gaussians) -> dict[str, bytes]:
    """The files of an unpacked model: 4 rows of 4 pixels, and each row's own harmonics."""
    files = {}
    count = len(gaussians)

    def stored(name: str, values: np.ndarray, levels: int = 255):
        least = values.min(0)
        largest = values.max(0)
        files[name] = np.round((values - least) / (largest - least) * levels).astype(np.uint16)
        return {"shape": [count, values.shape[1]], "mins": least.tolist(), "maxs": largest.tolist()}

    logs = np.sign(gaussians.means) * np.log1p(np.abs(gaussians.means))
    meta = {"means": stored("means", logs, 65535), "scales": stored("scales", np.log(gaussians.scales))}
    meta["sh0"] = stored("sh0", np.column_stack([gaussians.sh_coeffs[:, 0], gaussians.table["opacity"]]))
    quats = unit_quats(gaussians)
    largest = np.abs(quats).argmax(1)
    quats *= np.sign(quats[np.arange(count), largest])[:, None]
    smallest = np.stack([np.delete(quat, place) for quat, place in zip(quats, largest, strict=True)])
    files["quats"] = np.column_stack([to_bytes(127.5 * (smallest * np.sqrt(2) + 1)), 252 + largest])
    entries = np.zeros((64, 8, 3))
    entries[:count] = gaussians.sh_coeffs[:, 1:]
    meta["shN"] = stored("shN_centroids", entries.reshape(-1, 1)) | {"mins": entries.min(), "maxs": entries.max()}
    files["shN_labels"] = np.arange(count)[:, None]
    positions = files.pop("means")
    files["means_l"] = positions & 255
    files["means_u"] = positions >> 8
    names = {"means": ["means_l", "means_u"], "shN": ["shN_centroids", "shN_labels"]}
    for part in (*meta, "quats"):
        meta.setdefault(part, {})["files"] = [f"{name}.webp" for name in names.get(part, [part])]
    images = {}
    for name, values in files.items():
        if name == "shN_centroids":
            width = 512
            pixels = np.zeros((512, 4), np.uint8)
            pixels[:, :3] = values.reshape(512, 3)
        else:
            width = 4
            pixels = np.zeros((16, 4), np.uint8)
            pixels[: len(values), : values.shape[1]] = values
        images[f"{name}.webp"] = webp(pixels.reshape(-1, width, 4))
    return {"meta.json": json.dumps(meta).encode(), **images}


def unpacked_sog() -> dict[str, bytes]:
    with zipfile.ZipFile(SPLAT_TRANSFORM / "model.sog") as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def files() -> dict[str, bytes]:
    """Return the content of a model's files in every format and version, by path."""
    return {
        "model.splat": splat(model()),
        "version 2.spz": spz_of_version_2(model()),
        **{path.name: path.read_bytes() for path in SPLAT_TRANSFORM.iterdir()},
        **{f"version 1/{name}": data for name, data in sog_of_version_1(model()).items()},
        **{f"version 2/{name}": data for name, data in unpacked_sog().items()},
    }


def write_all(folder: Path) -> dict[str, Path]:
    """Write a model in every format and version; return the paths of all but images."""
    for name, data in files().items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(data)
    return {name: folder / name for name in files() if not name.endswith(".webp")}
