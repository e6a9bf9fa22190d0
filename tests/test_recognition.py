"""Files of other kinds that are named as a model: one line says what they are and what to do."""

import gzip
import io
import zipfile

import pytest

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


FILES = {
    "a Git LFS pointer (run `git lfs pull`)": [
        b"version https://git-lfs.github.com/spec/v1\noid sha256:abab\nsize 49600\n"
    ],
    "a git-annex pointer (run `git annex get`)": [b"/annex/objects/MD5E-s123--ab.ply\n"],
    "a web page (download": [b"\n<!DOCTYPE html>\n<html>", b"\xef\xbb\xbf<html lang='de'>", b"<?xml version='1.0'?>"],
    "text, 'Entry not found' (download": [b"Entry not found\n"],
    "a film or picture (": [b"\0\0\0\x18ftypmp42"],
    "a gzip archive (unpack it": [gzip.compress(b"ply\nformat", mtime=0)],
    "an archive (unpack it": [zipped("a/model.ply", "cfg_args"), b"7z\xbc\xaf\x27\x1c\0\4"],
    "a PyTorch checkpoint (export a .ply": [
        zipped("archive/data.pkl", "archive/data/0"),
        b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19.",
        b"\x40" + bytes(7) + b'{"means":',
    ],
    "arrays (export": [zipped("means.npy", "quats.npy"), b"\x93NUMPY\1\0"],
    "a picture (`gspure train`": [b"\x89PNG\r\n", b"\xff\xd8\xff\xe0", b"RIFF\1\2\3\4WEBPVP8L", b"II*\0\x08"],
    "a mesh (`gspure train`": [b"# Blender\n\n# www\nmtllib a.mtl\nv 0 0 0\n", b"glTF\2\0\0\0", b"solid cube\nfacet"],
    "Gaussians in glTF (save it": [
        b"glTF\2\0\0\0" + b' {"extensionsUsed": ["KHR_gaussian_splatting"]}',
        b'{"asset": {"version": "2.0"}, "extensionsUsed": ["KHR_gaussian_splatting"]}',
    ],
    "a USD scene (save it": [zipped("scene.usdc"), b"PXR-USDC", b"#usda 1.0"],
    "a point cloud (`gspure train`": [b"LASF\0\0"],
    "JSON (name the model's file)": [b'[{"id": 0}]', b'{"asset": {"version": "2.0"}}'],
    "an empty file (copy or": [b""],
}


@pytest.mark.parametrize("name", ["m.ply", "m.spz", "m.splat", "m.sog", "m"])
@pytest.mark.parametrize(
    ("description", "content"),
    [
        pytest.param(kind, content, id=f"{kind}{i}")
        for kind, contents in FILES.items()
        for i, content in enumerate(contents)
    ],
)
def test_a_file_of_another_kind_is_named_with_a_remedy(tmp_path, name, description, content):
    if name == "m.spz" and content[:2] == b"\x1f\x8b":
        description = "an SPZ model of version 2 to 4, found "
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_model(tmp_path / name)
    assert description in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("source", "name", "description"),
    [
        ("v3.spz", "m.ply", "a gzip archive .* one of SPZ is named .spz"),
        ("v4.spz", "m.ply", "an SPZ model .name it .spz"),
        ("model.sog", "m.ply", "a SOG model .name it .sog"),
        ("model.compressed.ply", "m.spz", "a PLY .name it .ply"),
    ],
)
def test_a_model_with_the_suffix_of_another_format_is_named(tmp_path, source, name, description):
    (tmp_path / name).write_bytes((SPLAT_TRANSFORM / source).read_bytes())
    with pytest.raises(InputError, match=f"found {description}"):
        read_model(tmp_path / name)


@pytest.mark.parametrize("names", [{"opacity": "alpha"}, {"scale_0": "s0", "scale_1": "s1", "scale_2": "s2"}])
def test_renamed_properties_are_listed(tmp_path, names):
    write_model(tmp_path / "m.ply", blobs(3, sh_degree=0))
    content = (tmp_path / "m.ply").read_bytes()
    for name, new_name in names.items():
        content = content.replace(f" {name}\n".encode(), f" {new_name}\n".encode())
    (tmp_path / "m.ply").write_bytes(content)
    with pytest.raises(InputError, match=f"no such property .renamed. It has {' '.join(names.values())}.$"):
        read_model(tmp_path / "m.ply")
