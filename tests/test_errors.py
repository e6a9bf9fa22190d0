"""The message of an InputError: one printable line of bounded length, whatever the file holds."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.errors import InputError, reading
from gspure.model import read_model

ANY_TEXT = st.text(st.characters(exclude_categories=()))  # control characters and lone surrogates included


@given(ANY_TEXT, ANY_TEXT, ANY_TEXT, ANY_TEXT, st.none() | ANY_TEXT)
def test_a_message_is_one_printable_line_whatever_a_file_holds(source, field, expected, value, hint):
    message = str(InputError(source, field, expected=expected, found=value * 10_000, hint=hint))
    assert message.isprintable()
    assert len(message.encode()) < 20_000


def test_bad_input_is_caught_as_python_names_it(tmp_path):
    absent = tmp_path / "absent.ply"
    foreign = tmp_path / "foreign.ply"
    with pytest.raises(FileNotFoundError) as caught:
        read_model(absent)
    assert str(caught.value) == f"{absent}: no such file"
    foreign.write_text("no ply")
    with pytest.raises(ValueError, match="a 3DGS"):
        read_model(foreign)


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (OSError(13, "denied", ".secret.npy"), "denied"),
        (ValueError("2\n\n  lines"), "2 lines"),
        (EOFError(), "EOFError"),
    ],
)
def test_an_error_while_reading_becomes_one_line(error, reason):
    with pytest.raises(InputError) as caught, reading("x.json", "JSON"):
        raise error
    assert str(caught.value) == f"x.json: file: expected JSON, found {reason}"
    assert caught.value.__cause__ is error
