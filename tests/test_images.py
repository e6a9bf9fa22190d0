import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from gspure.errors import InputError
from gspure.images import read_image, write_image


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


def test_an_image_is_float32_in_0_to_1_by_rows(tmp_path):
    array = np.zeros((3, 5, 3))
    array[2, 4] = [1, 0, 1]
    write_image(tmp_path / "deep" / "a.png", array)
    image = read_image(tmp_path / "deep" / "a.png")
    assert image.dtype == np.float32
    assert image.tolist() == array.tolist()


def test_the_same_image_gives_the_same_bytes(tmp_path):
    array = np.random.default_rng(0).random((20, 30, 3))
    write_image(tmp_path / "a.png", array)
    write_image(tmp_path / "b.png", array)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_grey_is_spread_over_three_channels_and_transparency_stands_on_black(tmp_path):
    Image.new("L", (2, 2), 51).save(tmp_path / "grey.png")
    assert read_image(tmp_path / "grey.png").tolist() == np.full((2, 2, 3), np.float32(0.2)).tolist()
    Image.new("RGBA", (2, 2), (255, 0, 100, 51)).save(tmp_path / "clear.png")
    assert read_image(tmp_path / "clear.png")[0, 0] * 255 == pytest.approx([51, 0, 20])


def test_a_photograph_is_reduced_to_the_size_of_its_view_and_left_alone_where_it_fits(tmp_path):
    ramp = np.repeat(np.linspace(0, 1, 64)[None, :, None], 32, axis=0).repeat(3, axis=2)
    write_image(tmp_path / "a.png", ramp)
    small = read_image(tmp_path / "a.png", size=(16, 8))
    assert small.shape == (8, 16, 3)
    expected = np.linspace(0, 1, 64).reshape(16, 4).mean(axis=1)
    assert small[4, 1:-1, 0] == pytest.approx(expected[1:-1], abs=2 / 255)
    assert read_image(tmp_path / "a.png", size=(64, 32)).tolist() == read_image(tmp_path / "a.png").tolist()


def test_a_photograph_is_never_enlarged(tmp_path):
    write_image(tmp_path / "a.png", np.zeros((4, 6, 3)))
    with pytest.raises(InputError, match="size: expected at least 7x4, found 6x4"):
        read_image(tmp_path / "a.png", size=(7, 4))


def test_a_missing_broken_or_deep_image_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match=r"none\.png: file: expected an image, found no such file"):
        read_image(tmp_path / "none.png")
    write_image(tmp_path / "cut.png", np.random.default_rng(0).random((40, 40, 3)))
    (tmp_path / "cut.png").write_bytes((tmp_path / "cut.png").read_bytes()[:-900])
    with pytest.raises(InputError, match=r"cut\.png: file: expected an image"):
        read_image(tmp_path / "cut.png")
    Image.fromarray(np.zeros((2, 2), np.uint16)).save(tmp_path / "deep.png")
    with pytest.raises(InputError, match=r"deep\.png: pixels: expected 8 bits per channel, found mode I;16"):
        read_image(tmp_path / "deep.png")


def test_a_failed_write_leaves_the_old_image(tmp_path):
    write_image(tmp_path / "a.png", np.ones((2, 2, 3)))
    with pytest.raises(TypeError):
        write_image(tmp_path / "a.png", np.ones((2, 2, 7)))
    assert read_image(tmp_path / "a.png").tolist() == np.ones((2, 2, 3)).tolist()
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
