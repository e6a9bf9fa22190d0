import struct
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from gspure.cameras.photographs import photograph, photograph_size
from gspure.errors import InputError
from gspure.images import FORMATS, read_image, write_image
from gspure.training.dataset import _with_photographs
from tests.models import camera


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(min_size=60, max_size=60))
def test_the_256_levels_survive_writing_and_reading(tmp_path, levels):
    pixels = np.frombuffer(levels, np.uint8).reshape(4, 5, 3)
    write_image(tmp_path / "a.png", pixels / np.float32(255))
    assert (read_image(tmp_path / "a.png") * 255).tolist() == pixels.tolist()


def test_values_are_clipped_and_a_half_rounds_up(tmp_path):
    values = np.array([-1, 0.5 / 255, 0.499 / 255, 254.5 / 255, 1, 7])
    write_image(tmp_path / "a.png", np.repeat(values, 3).reshape(1, 6, 3))
    assert (read_image(tmp_path / "a.png")[0, :, 0] * 255).tolist() == [0, 1, 0, 255, 255, 255]


def test_grey_is_spread_over_three_channels_and_transparency_stands_on_black(tmp_path):
    Image.new("L", (2, 2), 51).save(tmp_path / "grey.png")
    assert read_image(tmp_path / "grey.png").tolist() == np.full((2, 2, 3), np.float32(0.2)).tolist()
    Image.new("RGBA", (2, 2), (255, 0, 100, 51)).save(tmp_path / "clear.png")
    assert read_image(tmp_path / "clear.png")[0, 0] * 255 == pytest.approx([51, 0, 20])


def test_a_photograph_is_reduced_to_the_size_of_its_view(tmp_path):
    ramp = np.repeat(np.linspace(0, 1, 64)[None, :, None], 32, axis=0).repeat(3, axis=2)
    write_image(tmp_path / "a.png", ramp)
    small = read_image(tmp_path / "a.png", size=(16, 8))
    assert small.shape == (8, 16, 3)
    expected = np.linspace(0, 1, 64).reshape(16, 4).mean(axis=1)
    assert small[4, 1:-1, 0] == pytest.approx(expected[1:-1], abs=2 / 255)
    assert read_image(tmp_path / "a.png", size=(64, 32)).tolist() == read_image(tmp_path / "a.png").tolist()


def png(width, height, depth=8, colour=2, pixels=b""):
    """A PNG file; by default, it claims a size and holds next to nothing."""
    header = struct.pack(">2I5B", width, height, depth, colour, 0, 0, 0)
    chunks = {b"IHDR": header, b"IDAT": zlib.compress(pixels), b"IEND": b""}
    parts = (struct.pack(">I", len(c)) + t + c + struct.pack(">I", zlib.crc32(t + c)) for t, c in chunks.items())
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


@pytest.mark.parametrize("size", [(10_000, 14_000), (2**27 + 1, 1)])
def test_an_image_with_too_many_pixels_is_refused_before_it_is_decoded(tmp_path, size):
    (tmp_path / "a.png").write_bytes(png(*size))
    with pytest.raises(InputError, match=r"a\.png: size: expected at most 134217728 pixels"):
        photograph_size(tmp_path / "a.png")


def test_other_formats_are_refused_without_starting_other_programs(tmp_path, monkeypatch):
    monkeypatch.setattr("subprocess.Popen", None)
    Image.new("L", (4, 4)).save(tmp_path / "a.png", "EPS")
    with pytest.raises(InputError, match=r"a\.png: file: expected an image"):
        read_image(tmp_path / "a.png")


SUFFIXES = [(suffix, kind) for kind, suffixes in FORMATS.items() for suffix in suffixes] + [(".JPG", "MPO")]


@pytest.mark.parametrize(("suffix", "kind"), SUFFIXES)
def test_photographs_of_every_format_are_recognized_by_their_suffix_and_read(tmp_path, suffix, kind):
    Image.new("RGB", (4, 3), (255, 0, 0)).save(tmp_path / f"a{suffix}", kind)
    (view,) = _with_photographs([camera(4, 3, name="a")], tmp_path, tmp_path)
    assert photograph_size(photograph(view)) == (4, 3)
    assert read_image(photograph(view))[1, 1] == pytest.approx([1, 0, 0], abs=0.02)


DEEP = [png(4, 3, 16, colour, 3 * (b"\0" + bytes(8 * width))) for colour, width in ((0, 1), (2, 3), (4, 2), (6, 4))]


@pytest.mark.parametrize("content", [*DEEP, b"P6 4 3 1023\n" + bytes(72)], ids=["grey", "RGB", "LA", "RGBA", "PPM"])
def test_more_than_8_bits_per_channel_are_refused_and_not_cut(tmp_path, content):
    (tmp_path / "a").write_bytes(content)
    with pytest.raises(InputError, match="pixels: expected 8 bits per channel"):
        read_image(tmp_path / "a")


UNREAD = {
    "a.heic": (b"\0\0\0\x18ftypheic\0\0\0\0mif1heic", "HEIC"),
    "a.JPG": (b"\0\0\0\x24ftypmif1\0\0\0\0", "HEIC"),
    "a.avif": (b"\0\0\0\x20ftypavif\0\0\0\0", "AVIF"),
    "a.jxl": (b"\xff\x0a\xfa\x7f", "JPEG XL"),
    "b.jxl": (b"\0\0\0\x0cJXL \r\n\x87\n", "JPEG XL"),
    "a.jp2": (b"\0\0\0\x0cjP  \r\n\x87\n", "JPEG 2000"),
    "a.exr": (b"\x76\x2f\x31\x01\x02", "OpenEXR"),
    "a.CR2": (b"II*\0\x10\0\0\0CR", "a raw photograph"),
}


@pytest.mark.parametrize("name", UNREAD)
def test_a_photograph_of_another_format_is_named(tmp_path, name):
    content, kind = UNREAD[name]
    (tmp_path / name).write_bytes(content + bytes(100))
    for read in (read_image, photograph_size):
        with pytest.raises(InputError, match=rf"format: expected .*JPEG.*, found {kind} \(convert it to PNG or JPEG\)"):
            read(tmp_path / name)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("suffix", [".jpg", ".webp"])
def test_an_orientation_in_exif_data_is_mentioned_where_a_size_does_not_fit(tmp_path, suffix, orientation):
    exif = Image.Exif()
    exif[0x112] = orientation
    Image.new("RGB", (32, 24)).save(path := tmp_path / f"a{suffix}", exif=exif)
    assert read_image(path).shape == (24, 32, 3), "not applied"
    with pytest.raises(InputError, match="expected at least 24x32, found 32x24") as caught:
        read_image(path, (24, 32))
    assert ("EXIF" in str(caught.value)) == (orientation > 1)
