"""Files of other kinds that are named as a model: one line says what they are and what to do."""

import gzip
import io
import zipfile

import numpy as np
import pytest
from PIL import Image

from gspure.errors import InputError
from gspure.model import read_model, write_model
from tests.compressed_cases import SPLAT_TRANSFORM
from tests.models import blobs


def zipped(*names):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name in names:
            archive.writestr(name, b"content")
    return stream.getvalue()


def picture(kind):
    stream = io.BytesIO()
    Image.new("RGB", (4, 4)).save(stream, kind)
    return stream.getvalue()


def arrays(save):
    stream = io.BytesIO()
    save(stream, np.zeros(3))
    return stream.getvalue()


LFS = b"version https://git-lfs.github.com/spec/v1\noid sha256:abab\nsize 49600\n"
FILES = {
    "Git LFS": (LFS, "a Git LFS pointer (run `git lfs pull`)"),
    "git-annex": (b"/annex/objects/MD5E-s123--ab.ply\n", "a git-annex pointer (run `git annex get`)"),
    "a page": (b"\n<!DOCTYPE html>\n<html>", "a web page (download"),
    "another page": (b"\xef\xbb\xbf<html lang='de'>", "a web page (download"),
    "an error of a host": (b"Entry not found", "text, 'Entry not found' (download"),
    "a gzipped model": (gzip.compress(b"ply\nformat"), "a gzip archive (unpack it"),
    "a zipped model": (zipped("a/point_cloud.ply", "cfg_args"), "an archive of a/point_cloud.ply, cfg_args (unpack it"),
    "half an archive": (zipped("a.ply")[:-9], "an archive that was cut short (copy or"),
    "7z": (b"7z\xbc\xaf\x27\x1c\0\4", "an archive (unpack it"),
    "tar": (bytes(257) + b"ustar\0" + bytes(300), "an archive (unpack it"),
    "a checkpoint": (zipped("archive/data.pkl", "archive/data/0"), "a PyTorch checkpoint (export a .ply"),
    "an old checkpoint": (b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19.", "a PyTorch checkpoint (export a .ply"),
    "safetensors": (b"\x40" + bytes(7) + b'{"means":', "a PyTorch checkpoint (export a .ply"),
    "npz": (arrays(np.savez), "arrays of NumPy (export"),
    "npy": (arrays(np.save), "an array (export"),
    **{kind: (picture(kind), "a picture or a film (") for kind in ("PNG", "JPEG", "GIF", "WEBP", "BMP", "TIFF")},
    "OBJ": (b"# Blender\n\n# www\nmtllib a.mtl\nv 0 0 0\n", "a mesh (`gspure train`"),
    "glTF": (b"glTF\2\0\0\0", "a mesh (`gspure train`"),
    "STL": (b"solid cube\nfacet", "a mesh (`gspure train`"),
    "LAS": (b"LASF\0\0", "a point cloud (`gspure train`"),
    "cameras": (b'[{"id": 0}]', "JSON (name the model's file)"),
    "nothing": (b"", "an empty file (copy or"),
}


@pytest.mark.parametrize("name", ["m.ply", "m.spz", "m.splat", "m.sog", "m.ckpt"])
@pytest.mark.parametrize(("content", "found"), FILES.values(), ids=FILES)
def test_a_file_of_another_kind_is_named_with_a_remedy(tmp_path, name, content, found):
    if name == "m.spz" and content[:2] == b"\x1f\x8b":
        found = "an SPZ model of version 2 to 4, found "
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_model(tmp_path / name)
    assert found in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("source", "name", "found"),
    [
        ("v3.spz", "m.ply", "a gzip archive .* one of SPZ is named .spz"),
        ("v4.spz", "m.ply", "an SPZ model .name it .spz"),
        ("model.sog", "m.ply", "a SOG model .name it .sog"),
        ("model.compressed.ply", "m.spz", "a PLY .name it .ply"),
    ],
)
def test_a_model_with_the_suffix_of_another_format_is_named(tmp_path, source, name, found):
    (tmp_path / name).write_bytes((SPLAT_TRANSFORM / source).read_bytes())
    with pytest.raises(InputError, match=f"found {found}"):
        read_model(tmp_path / name)


@pytest.mark.parametrize("names", [{"opacity": "alpha"}, {"scale_0": "s0", "scale_1": "s1", "scale_2": "s2"}])
def test_renamed_properties_are_listed(tmp_path, names):
    write_model(tmp_path / "m.ply", blobs(3, sh_degree=0))
    content = (tmp_path / "m.ply").read_bytes()
    for name, other in names.items():
        content = content.replace(f" {name}\n".encode(), f" {other}\n".encode())
    (tmp_path / "m.ply").write_bytes(content)
    with pytest.raises(InputError, match=f"no such property .renamed. It has {' '.join(names.values())}.$"):
        read_model(tmp_path / "m.ply")


def test_a_truncated_model_is_said_to_be_cut_short(tmp_path):
    write_model(tmp_path / "m.ply", blobs(3))
    (tmp_path / "m.ply").write_bytes((tmp_path / "m.ply").read_bytes()[:-5])
    with pytest.raises(InputError, match=r"expected 3 rows, found room for 2 .cut short"):
        read_model(tmp_path / "m.ply")
