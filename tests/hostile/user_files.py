"""Readers of what users bring: models, cameras, photographs, keys, data sets, configurations."""

from __future__ import annotations

import importlib.util
import json
import warnings
from argparse import Namespace
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import numpy as np
import yaml
from PIL import Image

from gspure.artifacts import (
    replacing,
)
from gspure.cameras import read_cameras, read_points, write_cameras
from gspure.cameras.photographs import photograph_size
from gspure.cli.audit import _configuration as configuration_of
from gspure.datasets import Archive, extract
from gspure.datasets.fetching import _recorded as recorded_digest
from gspure.errors import InputError
from gspure.images import (
    read_image,
)
from gspure.model import Gaussians, read_model, require_finite, write_model
from gspure.model.inria import saved_iterations, training_arguments
from gspure.model.points import read_point_ply, write_point_ply
from gspure.schemes.gs_hider.files import COLUMNS as FEATURE_COLUMNS
from gspure.schemes.gs_hider.files import DecoderFile
from gspure.schemes.gs_hider.model import FeatureModel
from gspure.schemes.keyss.key import NetworkKey
from gspure.schemes.keyss.network import fresh
from gspure.schemes.keyss.network import random_key as random_vector
from gspure.schemes.secure_gs.model import AnchorModel, HiddenKey
from gspure.schemes.secure_gs.networks import PUBLIC
from gspure.schemes.splats_in_splats.key import SplatsInSplatsKey
from gspure.schemes.splats_in_splats.opacity_mapping import OpacityMapping
from gspure.training.checkpoints import Snapshot, read_checkpoint, write_checkpoint
from gspure.training.dataset import read_dataset, read_photographs
from gspure.workflow.configuration import resolved, validated
from tests.anchor_cases import random_key, random_public
from tests.compressed_cases import files, model, sog_of_version_1, unpacked_sog
from tests.hostile.archives import zipped
from tests.hostile.contract import Reader
from tests.models import blobs, camera
from tests.test_cameras_colmap import binary, text
from tests.training_cases import colmap_project, ring, state

ROWS = 12
SCHEMA = Path(__file__).parents[2] / "schemas" / "config.schema.yaml"
TORCH = importlib.util.find_spec("torch") is not None


# Models


def _read_model(path: Path, read: Callable[[Path], Gaussians] = read_model) -> None:
    model = read(path)
    assert len(model) > 0
    require_finite(model, path)
    assert all(np.isfinite(values).all() for values in (model.means, model.quats, model.opacities, model.sh_coeffs))
    assert ((model.opacities >= 0) & (model.opacities <= 1)).all()
    write_model(path.with_name("again.ply"), model)


def _ascii_model(folder: Path) -> None:
    from plyfile import PlyData

    write_model(folder / "model.ply", blobs(4))
    data = PlyData.read(folder / "model.ply", mmap=False)
    data.text = True
    data.write(folder / "model.ply")


def _feature_model(folder: Path) -> None:
    rng = np.random.default_rng(0)
    table = np.empty(ROWS, [(name, "<f4") for name in FEATURE_COLUMNS])
    for name in FEATURE_COLUMNS:
        table[name] = rng.standard_normal(ROWS)
    write_model(folder / "model.ply", Gaussians(table))


def _anchor_model(folder: Path) -> None:
    random_public(ROWS).write(folder / "point_cloud.ply")


def _read_anchors(folder: Path) -> None:
    asset = AnchorModel.read(folder)
    require_finite(asset.model, folder)
    anchors = asset.anchors
    assert anchors.offsets.shape == (len(asset.model), anchors.k, 3)


def _inria_folder(folder: Path) -> None:
    for iteration in (30, 200):
        write_model(folder / "point_cloud" / f"iteration_{iteration}" / "point_cloud.ply", blobs(4))
    (folder / "cfg_args").write_text(
        "Namespace(sh_degree=3, source_path='/data/garden', white_background=False, images='images_4', eval=True)"
    )


def _read_inria_folder(folder: Path) -> None:
    assert all(isinstance(number, int) for number in saved_iterations(folder))
    for name, value in training_arguments(folder).items():
        assert isinstance(name, str)
        assert isinstance(value, str | float | bool | int | None)
    _read_model(folder / "point_cloud" / "iteration_200" / "point_cloud.ply", lambda path: read_model(folder))


def _compressed(name: str, form: str, *, available: bool = True) -> Reader:
    def read(folder: Path) -> None:
        _read_model(folder / name)

    return Reader(f"model, {name}", partial(_write, files={name: files()[name]}), read, {name: form}, available)


# Cameras


def _camera_file(folder: Path) -> None:
    write_cameras(folder / "cameras.json", [camera(40, 30, name=name) for name in ("left_1", "left_2", "right_1")])


def _transforms(folder: Path) -> None:
    pose = [[1.0, 0.0, 0.0, 0.5], [0.0, 1.0, 0.0, 0.25], [0.0, 0.0, 1.0, -2.0], [0.0, 0.0, 0.0, 1.0]]
    shared = {"camera_model": "OPENCV", "fl_x": 50.0, "fl_y": 51.0, "cx": 20, "cy": 15, "w": 40, "h": 30, "k1": 0.0}
    frames = [{"file_path": f"images/left/{i:04d}.jpg", "transform_matrix": pose} for i in range(3)]
    frames.append({"file_path": "seen/r_0", "transform_matrix": pose, "camera_angle_x": 0.7})
    (folder / "transforms.json").write_text(json.dumps({**shared, "frames": frames}))


def _write(folder: Path, files: Mapping[str, bytes]) -> None:
    for name, content in files.items():
        (folder / name).write_bytes(content)


def _read_views(path: Path, folder: Path) -> None:
    cameras = read_cameras(path)
    assert len({each.name for each in cameras}) == len(cameras) > 0
    (folder / "out").mkdir()
    for view in cameras:
        assert 1 <= view.width <= 65535
        assert 1 <= view.height <= 65535
        assert np.isfinite(view.K).all()
        assert np.isfinite(view.viewmat).all()
        assert view.name.isprintable()
    for view in cameras[:3]:
        with replacing(folder / "out" / f"{view.name}.{'0' * 32}.npy") as temporary:
            temporary.touch()
    assert {path.parent for path in (folder / "out").rglob("*")} <= {folder / "out"}
    write_cameras(folder / "again.json", cameras)


def _read_points(points: tuple[np.ndarray, np.ndarray]) -> None:
    xyz, rgb = points
    assert xyz.shape == rgb.shape == (len(xyz), 3)
    assert np.isfinite(xyz).all()
    assert rgb.dtype == np.uint8


def _point_ply(folder: Path) -> None:
    rng = np.random.default_rng(0)
    write_point_ply(
        folder / "points.ply", rng.normal(size=(ROWS, 3)), rng.integers(256, size=(ROWS, 3), dtype=np.uint8)
    )


# Images

IMAGES = {
    "rgb.png": "RGB",
    "rgba.png": "RGBA",
    "palette.png": "P",
    "photo.jpg": "RGB",
    "photo.tif": "RGB",
    "photo.webp": "RGB",
}


def _images(folder: Path) -> None:
    pixels = np.random.default_rng(0).integers(256, size=(10, 12, 4), dtype=np.uint8)
    for name, mode in IMAGES.items():
        Image.fromarray(pixels).convert(mode).save(folder / name)


def _read_images(folder: Path) -> None:
    for name in IMAGES:
        photograph_size(folder / name)
        image = read_image(folder / name)
        assert image.ndim == 3
        assert image.shape[2] == 3
        assert ((image >= 0) & (image <= 1)).all()


# Keys and networks


def _splats_key(folder: Path) -> None:
    rng = np.random.default_rng(0)
    SplatsInSplatsKey(blobs(ROWS).means[:5], OpacityMapping.fresh(rng), 10, blobs(ROWS)).write(folder)


def _keyss_key(folder: Path) -> None:
    rng = np.random.default_rng(0)
    NetworkKey(random_vector(rng), fresh(rng)).write(folder)


def _decoder(folder: Path) -> None:
    from gspure.schemes.gs_hider.decoder import untrained

    (decoder,) = untrained(1, 0)
    DecoderFile.of(decoder, 7, "net").write(folder)


def _split_networks(folder: Path) -> None:
    """One TorchScript trace each, as Scaffold-GS leaves them."""
    import torch

    from tests.test_scaffold_files import modules

    asset = random_public(ROWS)
    asset.write(folder / "point_cloud.ply")
    (folder / "checkpoints.pth").unlink()
    for name, module in modules(asset.networks).items():
        inputs = asset.networks[name]["0.weight"].shape[1]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # TorchScript is deprecated, but that is what there is to be read
            torch.jit.trace(module, torch.rand(1, inputs)).save(folder / f"{name}_mlp.pt")


def _checkpoint(folder: Path) -> None:
    rng = np.random.default_rng(0).bit_generator.state
    write_checkpoint(folder / "checkpoint.npz", Snapshot(10, state(6), (1, 2), rng), {"iterations": 20})


def _read_checkpoint(folder: Path) -> None:
    snapshot = read_checkpoint(folder / "checkpoint.npz", {"iterations": 20})
    np.random.default_rng().bit_generator.state = snapshot.rng
    for part in vars(snapshot.state).values():
        for name, array in vars(part).items():
            assert array.dtype == np.float32, name
            assert len(array) == len(snapshot.state.parameters.means), name
    assert snapshot.iteration >= 0


# Data sets and configurations


def _dataset(folder: Path) -> None:
    files = {f"garden/images_4/{i}.jpg": b"photograph" * 9 for i in range(3)} | {
        "garden/sparse/0/cameras.bin": b"c" * 60
    }
    (folder / "scenes.zip").write_bytes(zipped([*files.items(), ("stump/images_4/0.jpg", b"other")]))


def _read_dataset(folder: Path) -> None:
    archive = Archive("https://example.org/scenes.zip", "", {"garden": "images_4"})
    extract(folder / "scenes.zip", archive, "garden", folder / "out", sha256="0" * 64)
    unpacked = [path for path in (folder / "out").rglob("*") if not path.is_dir()]
    assert all(path.is_file() and not path.is_symlink() for path in unpacked)
    assert {path.relative_to(folder / "out").parts[0] for path in unpacked} == {"images", "sparse", "origin.json"}


def _capture(folder: Path) -> None:
    views = ring(3, 8, 6)
    colmap_project(folder, views, np.random.default_rng(0).uniform(-0.5, 0.5, (40, 3)))


def _read_capture(folder: Path) -> None:
    dataset = read_dataset(folder, "native")
    assert dataset.train
    assert np.isfinite(dataset.xyz).all()
    for view, image in zip(dataset.train, read_photographs(dataset.train), strict=True):
        assert image.shape == (view.height, view.width, 3)
        assert ((image >= 0) & (image <= 1)).all()


def _configuration(folder: Path) -> None:
    write_model(folder / "model.ply", blobs(4))
    config = {
        "assets": {
            "bot": {"model": str(folder / "model.ply"), "cameras": "orbit", "generated": {"count": 9, "width": 32}}
        },
        "pairs": {"room": {"views": 9}},
        "schemes": {"keyss": {"iterations": 30}},
        "method": {"min_samples": 3, "tau_n": 2.5},
        "decisions": {"finer": {"min_samples": 5}},
        "variants": {"unattacked": {}, "gspure": {}, "half": {"attack": "random_pruning", "fraction": 0.5, "seed": 1}},
    }
    (folder / "config.yaml").write_text(yaml.safe_dump(config))


def _read_configuration(folder: Path) -> None:
    path = configuration_of(Namespace(source=folder / "config.yaml", cameras=None, up=None), folder / "audit.yaml")
    config = yaml.safe_load(path.read_text(encoding="utf-8"))
    if not isinstance(config, dict):  # reported by Snakemake
        raise InputError(path, "file", expected="settings", found=type(config).__name__)
    settled = resolved(validated(config, SCHEMA, path), path)
    for name in (*settled["assets"], *settled["pairs"], *settled["variants"], *settled["decisions"]):
        assert Path(name).name == name


READERS = (
    Reader(
        "model, binary",
        lambda f: write_model(f / "model.ply", blobs(ROWS, sh_degree=1)),
        lambda f: _read_model(f / "model.ply"),
        {"model.ply": "ply"},
    ),
    Reader("model, ASCII", _ascii_model, lambda f: _read_model(f / "model.ply"), {"model.ply": "ply"}),
    Reader(
        "model of GS-Hider",
        _feature_model,
        lambda f: _read_model(f / "model.ply", lambda path: FeatureModel.read(path).model),
        {"model.ply": "ply"},
    ),
    Reader(
        "model of SecureGS, .pth",
        _anchor_model,
        _read_anchors,
        {"point_cloud.ply": "ply", "checkpoints.pth": "pth"},
    ),
    Reader(
        "model of SecureGS, .pt", _split_networks, _read_anchors, {f"{name}_mlp.pt": "pth" for name in PUBLIC}, TORCH
    ),
    Reader(
        "INRIA folder",
        _inria_folder,
        _read_inria_folder,
        {"cfg_args": "text", "point_cloud/iteration_200/point_cloud.ply": "ply"},
    ),
    _compressed("model.compressed.ply", "ply"),
    _compressed("model.splat", "bytes"),
    *(_compressed(f"level {level}.ksplat", "bytes") for level in range(3)),
    _compressed("version 2.spz", "gzip"),
    _compressed("v3.spz", "gzip"),
    _compressed("v4.spz", "bytes", available=importlib.util.find_spec("zstandard") is not None),
    _compressed("model.sog", "zip"),
    *(
        Reader(
            f"SOG, version {version}",
            partial(_write, files=unpacked),
            lambda f: _read_model(f / "meta.json"),
            {"meta.json": "json", "means_l.webp": "bytes", "shN_centroids.webp": "bytes"},
        )
        for version, unpacked in ((1, sog_of_version_1(model())), (2, unpacked_sog()))
    ),
    Reader("cameras.json", _camera_file, lambda f: _read_views(f / "cameras.json", f), {"cameras.json": "json"}),
    Reader(
        "transforms.json", _transforms, lambda f: _read_views(f / "transforms.json", f), {"transforms.json": "json"}
    ),
    Reader(
        "COLMAP, text",
        lambda f: _write(f, text()),
        lambda f: _read_views(f, f),
        {"cameras.txt": "text", "images.txt": "text"},
    ),
    Reader(
        "COLMAP, binary",
        lambda f: _write(f, binary()),
        lambda f: _read_views(f, f),
        {"cameras.bin": "bytes", "images.bin": "bytes"},
    ),
    Reader(
        "COLMAP points, text",
        lambda f: _write(f, text()),
        lambda f: _read_points(read_points(f)),
        {"points3D.txt": "text"},
    ),
    Reader(
        "COLMAP points, binary",
        lambda f: _write(f, binary()),
        lambda f: _read_points(read_points(f)),
        {"points3D.bin": "bytes"},
    ),
    Reader("points3D.ply", _point_ply, lambda f: _read_points(read_point_ply(f / "points.ply")), {"points.ply": "ply"}),
    Reader("image", _images, _read_images, {name: "png" if name.endswith(".png") else "bytes" for name in IMAGES}),
    Reader(
        "key of Splats in Splats",
        _splats_key,
        SplatsInSplatsKey.read,
        {"splats_in_splats.npz": "npz", "hidden.ply": "ply"},
    ),
    Reader("key of SecureGS", lambda f: random_key().write(f), HiddenKey.read, {"securegs_hidden.npz": "npz"}),
    Reader("key of KeySS", _keyss_key, NetworkKey.read, {"keyss.npz": "npz"}),
    Reader(
        "decoder of GS-Hider",
        _decoder,
        lambda f: DecoderFile.read(f / "chkpnt7_net.pth").network,
        {"chkpnt7_net.pth": "pth"},
        TORCH,
    ),
    Reader("checkpoint", _checkpoint, _read_checkpoint, {"checkpoint.npz": "npz"}),
    Reader("data set", _dataset, _read_dataset, {"scenes.zip": "zip"}),
    Reader(
        "digest of a download",
        lambda f: (f / "scenes.zip.sha256").write_text(f"{'0a' * 32}  scenes.zip\n"),
        lambda f: int(recorded_digest(f / "scenes.zip.sha256"), 16),
        {"scenes.zip.sha256": "text"},
    ),
    Reader(
        "capture",
        _capture,
        _read_capture,
        {
            "sparse/0/cameras.txt": "text",
            "sparse/0/images.txt": "text",
            "sparse/0/points3D.txt": "text",
            "images/orbit_001.png": "png",
        },
    ),
    Reader("configuration", _configuration, _read_configuration, {"config.yaml": "text"}),
)
