"""The message of an InputError: one printable line of bounded length, whatever the file holds."""

import lzma
import os
import struct
import tokenize
import zipfile
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.cameras import read_cameras
from gspure.errors import InputError, reading
from gspure.evaluation.comparison import read_metrics
from gspure.files import load_array, load_arrays, read_json
from gspure.images import read_image
from gspure.method.contributions import read_index
from gspure.model import read_model
from gspure.model.ply import read_point_ply
from gspure.schemes.gs_hider.files import DecoderFile
from gspure.schemes.tensors import read_tensors

ANY_TEXT = st.text(st.characters(exclude_categories=()))  # control characters and lone surrogates included


@given(ANY_TEXT, ANY_TEXT, ANY_TEXT, ANY_TEXT, st.none() | ANY_TEXT)
def test_a_message_is_one_printable_line_whatever_a_file_holds(source, field, expected, found, hint):
    message = str(InputError(source, field, expected=expected, found=found, hint=hint))
    assert message.isprintable()
    message.encode()  # no lone surrogates


def test_escape_sequences_and_line_breaks_are_escaped():
    error = InputError("a\n.ply", "x", expected="a number", found="\x1b[2J\r\u202e")
    assert str(error) == r"a\n.ply: x: expected a number, found \x1b[2J\r\u202e"


def test_bad_input_is_caught_as_python_names_it(tmp_path):
    absent, other = tmp_path / "absent.ply", tmp_path / "other.ply"
    with pytest.raises(FileNotFoundError) as caught:
        read_model(absent)
    assert str(caught.value) == f"{absent}: no such file"
    other.write_text("no ply")
    with pytest.raises(ValueError, match="a 3DGS") as caught:
        read_model(other)
    assert not isinstance(caught.value, FileNotFoundError)


def test_long_text_is_cut_but_the_path_is_kept():
    path = "a/" * 1000
    message = str(InputError(path, "x", expected="a number", found="9" * 10**6))
    assert message.startswith(f"{path}: x: ")
    assert message.endswith("999...")
    assert len(message) < 3000


@pytest.mark.parametrize(
    ("error", "found"),
    [
        (PermissionError(13, "Permission denied", ".secret.1234.npy"), "Permission denied"),
        (OSError("image file is truncated"), "image file is truncated"),
        (MemoryError("Unable to allocate 7 EiB"), "Unable to allocate 7 EiB"),
        (ValueError("two\n\n  lines"), "two lines"),
        (EOFError(), "EOFError"),
        *((kind("corrupt"), "corrupt") for kind in (AttributeError, OverflowError, TypeError, SyntaxError)),
        *((kind("corrupt"), "corrupt") for kind in (RuntimeError, NotImplementedError, zipfile.BadZipFile)),
        *((kind("corrupt"), "corrupt") for kind in (struct.error, tokenize.TokenError, zlib.error, lzma.LZMAError)),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Exception) else "",
)
def test_any_error_while_reading_becomes_one_line(error, found):
    with pytest.raises(InputError) as caught, reading("x.json", "JSON"):
        raise error
    assert str(caught.value) == f"x.json: file: expected JSON, found {found}"
    assert caught.value.__cause__ is error


@pytest.mark.parametrize(
    "read",
    [
        read_model,
        read_point_ply,
        read_json,
        read_cameras,
        read_metrics,
        read_index,
        read_image,
        read_tensors,
        DecoderFile.read,
        lambda path: load_array(path, dtype=np.float32, shape=(None,)),
        lambda path: load_arrays(path, {}, "arrays"),
    ],
)
def test_a_pipe_and_a_device_are_refused_by_every_reader(tmp_path, read):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zero").symlink_to("/dev/zero")
    for name in ("pipe", "zero"):
        with pytest.raises(InputError, match=f"{name}: file: expected .*, found a folder, a pipe or a device"):
            read(tmp_path / name)


def test_a_more_precise_error_is_kept():
    precise = InputError("x.json", "[3].fx", expected="a number", found="nothing")
    with pytest.raises(InputError) as caught, reading("x.json", "JSON"):
        raise precise
    assert caught.value is precise


def test_an_interruption_is_not_reported_as_corruption():
    with pytest.raises(KeyboardInterrupt), reading("x.json", "JSON"):
        raise KeyboardInterrupt
