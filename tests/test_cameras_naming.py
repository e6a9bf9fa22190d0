"""Names of views: whatever a file calls a photograph, the name stays one visible file inside the output folder."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gspure.cameras import read_cameras
from gspure.cameras.photographs import LONGEST_NAME, safe_name

OUT = Path("/out/folder").resolve()
PIECES = ("/", "\\", "..", ".", "~", " ", "\0", "\n", "\x1b[2J", "\ud800", "\u202e", "e\u0301", "images", ".JPG", "C:")
ANY_TEXT = st.text(st.characters(exclude_categories=()), max_size=400)
HOSTILE = st.lists(st.sampled_from(PIECES) | st.text("ab.", max_size=3), max_size=12).map("".join)


@given(ANY_TEXT | HOSTILE)
@example("//x/y")
@example("../../etc/passwd")
@example("a.jpg .png ")
@example("images/" + "é" * 300)
def test_a_name_is_one_visible_file_inside_the_output_folder(text):
    name = safe_name(text)
    if not name:  # refused by the readers
        assert not text.replace("\\", "/").strip("/. ")
        return
    for file in (f"{name}.png", name):
        path = (OUT / file).resolve()
        assert path.parent == OUT
        assert path.name == file
    assert not name.startswith(".")
    assert name.isprintable()
    assert len(name.encode()) <= LONGEST_NAME
    assert safe_name(name) == name, "written to cameras.json, the name must come back"


def written(folder, names):
    frames = [{"file_path": name, "transform_matrix": np.eye(4).tolist()} for name in names]
    (folder / "transforms.json").write_text(json.dumps({"w": 8, "h": 6, "fl_x": 8, "frames": frames}))
    return folder


@pytest.mark.parametrize(
    ("files", "names"),
    [
        ("left/images/1.jpg right/images/1.jpg", "left_1 right_1"),
        ("a/left/images_2/1.jpg a/right/images_2/1.png a/images/2.jpg", "left_1 right_1 2"),
        ("images/1.jpg images/1.png images/2.jpg", "1_jpg 1_png 2"),
        ("x/images/1.jpg x/images/1.png y/images/1.jpg", "x_1_jpg x_1_png y_1_jpg"),
        ("a/b a_b.png", "a_b a_b_png"),
        ("r_0 r_1 r_0 r_0", "r_0_1 r_1 r_0_2 r_0_3"),
        ("r_0 r_0_1 r_0", "r_0_2 r_0_1 r_0_3"),
        ("left/images/1.jpg right/images/1.jpg images/left_1.jpg", "left_1_jpg right_1_jpg left_1"),
        ("C:\\l\\images\\1.JPG C:\\r\\images\\1.JPG", "l_1 r_1"),
        ("Images/1.jpg images/1.jpg", "Images_1 1"),
        (" ".join(["x" * 200] * 2), None),
    ],
)
def test_equal_names_are_kept_apart_by_what_distinguishes_their_files(tmp_path, capsys, files, names):
    views = [camera.name for camera in read_cameras(written(tmp_path, files.split()))]
    assert len({*views}) == len(files.split())
    assert names is None or views == names.split()
    assert [safe_name(view) for view in views] == views, "written to cameras.json, the names must come back"
    assert capsys.readouterr().err.count("kept apart") == (names != "Images_1 1")
