"""Models in the compressed formats of converters and viewers."""

import gzip
import json
import os
import shutil
import struct
import sys
from unittest.mock import Mock

import numpy as np
import pytest
from PIL import Image

import gspure
from gspure.errors import InputError
from gspure.model import read_model, write_model
from gspure.model.copies import copies_in
from tests.compressed_cases import SPLAT_TRANSFORM, model, unpacked_sog, write_all
from tests.models import blobs, covariances

NAMES = ["model.splat", "v2.spz", "v3.spz", "v4.spz", "model.compressed.ply"]
NAMES += ["v1.sog", "unpacked/meta.json", "model.sog"]

# Of log scales, opacities, covariances relative to the largest, and coefficients.
PRECISION = {".splat": (0, 0.01, 0.03, None), ".spz": (0.04, 0.01, 0.07, 0.07)}
PRECISION |= {".ply": (0.01, 0.01, 0.02, 0.02), ".sog": (0.03, 0.04, 0.05, 0.4), ".json": (0.03, 0.04, 0.05, 0.4)}


def refused(path, match):
    with pytest.raises(InputError, match=match):
        read_model(path)


def needs_zstandard(name):
    if name == "v4.spz":
        pytest.importorskip("zstandard", reason="gspure[compression] is not installed")


def rewritten(folder, suffix, before):
    """Write a model in a compressed format, and return what is read of it."""
    pytest.importorskip("gsply", reason="gspure[compression] is not installed")
    write_model(folder / f"m{suffix}", before)
    return read_model(folder / f"m{suffix}")


def assert_near(after, before, precision):
    scales, opacities, shapes, coeffs = precision
    np.testing.assert_allclose(after.means, before.means, atol=5e-3)
    np.testing.assert_allclose(np.log(after.scales), np.log(before.scales), atol=scales)
    np.testing.assert_allclose(after.opacities, before.opacities, atol=opacities)
    assert np.abs(covariances(after) - covariances(before)).max() < shapes * covariances(before).max()
    if coeffs:
        np.testing.assert_allclose(after.sh_coeffs[:, 1:], before.sh_coeffs[:, 1:], atol=coeffs)


@pytest.mark.parametrize("name", NAMES)
def test_a_model_in_every_format_is_read_nearly_as_it_was(tmp_path, name):
    needs_zstandard(name)
    path = write_all(tmp_path)[name]
    before = model()
    after = read_model(path)
    nearest = np.linalg.norm(before.means[:, None] - after.means, axis=2).argmin(1)
    assert len({*nearest.tolist()}) == len(before)
    after = after[nearest]
    assert_near(after, before, PRECISION[path.suffix])
    visible = np.abs(before.sh_coeffs[:, 0]) < 1.7  # other colours are beyond 0 to 1
    np.testing.assert_allclose(after.sh_coeffs[:, 0][visible], before.sh_coeffs[:, 0][visible], atol=0.05)


@pytest.mark.parametrize("name", ["model.sog", "unpacked/meta.json"])
def test_a_model_is_decoded_once_for_each_content(tmp_path, monkeypatch, name):
    path = write_all(tmp_path)[name]
    before = read_model(path)
    reader = Mock(return_value=before.with_comment("decoded"))
    monkeypatch.setitem(gspure.model._READERS, path.name if path.name == "meta.json" else path.suffix, reader)
    with copies_in(tmp_path / "copies"):
        models = [read_model(path) for _ in range(3)]
        assert reader.call_count == 1
        os.utime(path)
        models.append(read_model(path))
        assert reader.call_count == 2
        for rows in tmp_path.glob("copies/*/rows.npy"):  # as if their writer had been killed
            rows.unlink()
        models.append(read_model(path))
    assert reader.call_count == 3
    assert all(model.table.tobytes() == before.table.tobytes() for model in models)
    assert {model.comments for model in models} == {(*before.comments, "decoded")}


@pytest.mark.parametrize("suffix", [".compressed.ply", ".spz"])
@pytest.mark.parametrize("degree", [0, 3])
def test_a_written_model_is_read_nearly_as_it_was(tmp_path, suffix, degree):
    before = blobs(300, sh_degree=degree)
    assert_near(rewritten(tmp_path, suffix, before), before, (0.04, 0.003, 0.1, 0.07))
    assert (tmp_path / f"m{suffix}").stat().st_size < 300 * 4 * len(before.table.dtype) / 3


@pytest.mark.parametrize("suffix", [".compressed.ply", ".spz"])
def test_comments_and_the_background_among_them_survive(tmp_path, suffix):
    before = blobs(300).with_background((1, 0.5, 0)).with_comment("another\nof two lines")
    after = rewritten(tmp_path, suffix, before)
    assert after.background == (1, 0.5, 0)
    assert after.comments[-2:] == ("another", "of two lines")
    import gsply

    read_by_others = gsply.read_spz if suffix == ".spz" else gsply.plyread
    assert len(read_by_others(tmp_path / f"m{suffix}")) == 300
    foreign = "\udcff café \x85"  # a byte that is no UTF-8, and what ends a line in other encodings
    assert rewritten(tmp_path, suffix, before.with_comment(foreign)).comments[-1] == foreign


@pytest.mark.parametrize(("suffix", "columns"), [(".compressed.ply", 2), (".spz", 3)])
def test_rows_whose_values_a_format_cannot_hold_are_counted(tmp_path, capsys, suffix, columns):
    before = blobs(60, sh_degree=1).with_columns({f"f_dc_{i}": np.zeros(60) for i in range(3)})
    for rows, (name, value) in enumerate([("f_rest_4", 4.1), ("scale_1", -21.0), ("f_dc_2", 3.4)], 1):
        before.table[name][:rows] = value
    rewritten(tmp_path, suffix, before)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == columns
    assert all(f"{rows} of 60 rows" in "".join(lines) for rows in range(1, columns + 1))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("suffix", [".compressed.ply", ".spz"])
def test_rows_that_are_no_numbers_are_written_as_invisible(tmp_path, capsys, suffix):
    before = blobs(60)
    before.table["opacity"][:3] = np.inf, -np.inf, 120
    before.table["x"][4] = np.nan
    after = rewritten(tmp_path, suffix, before).opacities
    np.testing.assert_array_equal(after[[0, 1, 2, 4]] > 0.5, [True, False, True, False])
    assert "1 of 60 rows are not finite" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "lossless", "message"),
    [("quats.webp", True, "rotations without their largest component"), ("means_l.webp", False, "a lossy image")],
)
def test_images_of_a_sog_model_that_lost_numbers_are_refused(tmp_path, name, lossless, message):
    index = write_all(tmp_path)["unpacked/meta.json"]
    Image.open(index.with_name(name)).convert("RGB").save(index.with_name(name), lossless=lossless, exact=True)
    refused(index, message)


AXES, SCALES = 0xADBE0003, 0xADBE0001  # types of extensions; the axes 4 are right, up, back


@pytest.mark.parametrize(("kind", "value", "is_read"), [(AXES, 4, True), (AXES, 6, False), (SCALES, 4, False)])
def test_an_spz_file_of_other_axes_or_scales_is_refused(tmp_path, kind, value, is_read):
    path = tmp_path / "m.spz"
    records = struct.pack("<6I", 0x12340001, 4, 9, kind, 4, value)
    data = gzip.decompress((SPLAT_TRANSFORM / "v3.spz").read_bytes())
    path.write_bytes(gzip.compress(data[:14] + b"\3" + data[15:] + records))
    if is_read:
        assert read_model(path).table.tobytes() == read_model(SPLAT_TRANSFORM / "v3.spz").table.tobytes()
        assert read_model(path).render_mode == "mip"
    else:
        refused(path, "other axes than right, up, back")


def test_a_name_of_another_format_is_not_written(tmp_path):
    with pytest.raises(InputError, match=r"format: expected \.ply, \.compressed\.ply or \.spz"):
        write_model(tmp_path / "m.sog", blobs(3))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("name", "package"), [("v4.spz", "zstandard"), ("new.spz", "gsply")])
def test_a_missing_package_is_named_with_its_extra(tmp_path, monkeypatch, name, package):
    monkeypatch.setitem(sys.modules, package, None)
    write_all(tmp_path)
    with pytest.raises(InputError, match=rf"the package {package}.*pip install 'gspure\[compression\]"):
        read_model(tmp_path / name) if (tmp_path / name).exists() else write_model(tmp_path / name, blobs(3))


@pytest.mark.parametrize("name", NAMES)
def test_a_cut_or_continued_file_is_refused(tmp_path, name):
    needs_zstandard(name)
    path = write_all(tmp_path)[name]
    data = path.read_bytes()
    continued = [data + b"\0"] if path.suffix == ".splat" else []
    for corrupt in (b"", data[:-1], data[: len(data) // 2 - 1], *continued):
        path.write_bytes(corrupt)
        refused(path, path.name)


def test_rows_that_would_unpack_to_too_much_are_refused_unread(tmp_path):
    paths = write_all(tmp_path)
    head = gzip.decompress(paths["v3.spz"].read_bytes())
    paths["v3.spz"].write_bytes(gzip.compress(head[:8] + (1 << 28).to_bytes(4, "little") + head[12:]))
    refused(paths["v3.spz"], "size: expected at most .* bytes unpacked")
    meta = json.loads(paths["unpacked/meta.json"].read_bytes())
    paths["unpacked/meta.json"].write_text(json.dumps(meta | {"count": 1 << 28}))
    refused(paths["unpacked/meta.json"], "size: expected at most .* bytes unpacked")


def test_images_elsewhere_are_not_read(tmp_path):
    for name, data in unpacked_sog().items():
        (tmp_path / name).write_bytes(data.replace(b'"means_l.webp"', b'"../means_l.webp"'))
    refused(tmp_path, "a file elsewhere")


@pytest.mark.parametrize(
    ("name", "remedy"), [("m.ksplat", "splat-transform"), ("m.LCC", "splat-transform"), ("m.spx", "save")]
)
def test_a_format_that_is_not_read_is_refused_with_a_remedy(tmp_path, name, remedy):
    (tmp_path / name).touch()
    refused(tmp_path / name, f"format: expected .ply, .spz, .sog or .splat, found {name} .*{remedy}")


@pytest.mark.parametrize(
    ("version", "degree", "message"),
    [
        (1, 0, "version: expected 2 to 4, found 1 .save it"),
        (5, 0, "version: expected 2 to 4, found 5 .save it"),
        (3, 4, "f_rest_.: expected .*, found 72, SH degree 4 .train it"),
    ],
)
def test_an_spz_model_of_another_version_or_degree_is_refused_with_a_remedy(tmp_path, version, degree, message):
    head = struct.pack("<4sIIBBBB", b"NGSP", version, 3, degree, 12, 0, 0)
    (tmp_path / "m.spz").write_bytes(gzip.compress(head + bytes(300)))
    refused(tmp_path / "m.spz", message)


@pytest.mark.parametrize("names", [("a.sog", "b.sog"), ("lod0_0.sog", "lod1_0.sog", "env.sog")])
def test_two_chunks_of_a_folder_without_an_index_are_one_model_of_the_finest_level(tmp_path, names):
    for name in names:
        shutil.copy(SPLAT_TRANSFORM / "model.sog", tmp_path / name)
    assert len(read_model(tmp_path)) == 2 * len(read_model(tmp_path / names[0]))
    write_model(tmp_path / "other.ply", read_model(tmp_path / names[0]))
    refused(tmp_path, "name one of")


def streamed(folder, **more):
    """Write a streamed model of a chunk for the finest level of each half, and one for a coarser level of both."""
    lods = {
        "left": {"1": {"file": 2, "offset": 0, "count": 4}, "0": {"file": 1, "offset": 1, "count": 11}},
        "right": {"0": {"file": 0, "offset": 0, "count": 12}},
    }
    for chunk in ("0_0", "0_1", "1_0", "env"):
        shutil.unpack_archive(SPLAT_TRANSFORM / "model.sog", folder / chunk, "zip")
    index = {"lodLevels": 2, "filenames": [f"{chunk}/meta.json" for chunk in ("0_0", "0_1", "1_0")]}
    index["tree"] = {"children": [{"lods": lods["left"]}, {"children": [{"lods": lods["right"]}]}]}
    (folder / "lod-meta.json").write_text(json.dumps(index | {"environment": "env/meta.json"} | more))
    return folder / "lod-meta.json"


def test_the_chunks_of_the_finest_level_of_a_streamed_model_and_its_environment_are_read_together(tmp_path):
    index = streamed(tmp_path)
    chunk = read_model(tmp_path / "0_0").table
    for path in (index, tmp_path):
        assert read_model(path).table.tobytes() == np.concatenate([chunk[1:], chunk, chunk]).tobytes()


@pytest.mark.parametrize(
    "more",
    [
        {"filenames": ["../0_0/meta.json"] * 3},
        {"tree": {}, "environment": None},
        {"filenames": ["0_0/meta.json"]},
        {"tree": {"lods": {"0": {"file": 0, "offset": 0, "count": 13}}}},
    ],
)
def test_a_streamed_model_that_names_no_rows_of_its_own_is_refused(tmp_path, more):
    refused(streamed(tmp_path, **more), "lod-meta.json: file: expected a streamed SOG model")
