import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gspure.errors import InputError
from gspure.model import Gaussians, read_model, write_model
from tests.models import blobs

CORE = ["x", "y", "z", "opacity", *(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4))]
PLY_TYPES = {"<f4": "float", "<f8": "double", "|u1": "uchar", "|i1": "char", "<u2": "ushort", "<i4": "int"}


def vanilla_columns(degree):
    """The columns of the INRIA trainer, in its order."""
    colour = [f"f_dc_{i}" for i in range(3)] + [f"f_rest_{i}" for i in range(3 * (degree + 1) ** 2 - 3)]
    return ["x", "y", "z", "nx", "ny", "nz", *colour, *CORE[3:]]


def header(dtype, count, encoding="binary_little_endian", lines=()):
    """A PLY header in the form that plyfile, and so the INRIA trainer, writes."""
    properties = [f"property {PLY_TYPES[dtype[name].newbyteorder('<').str]} {name}" for name in dtype.names]
    text = ["ply", f"format {encoding} 1.0", *lines, f"element vertex {count}", *properties, "end_header"]
    return "".join(line + "\n" for line in text).encode()


def random_table(dtype, count, seed=0):
    """Rows of random bits: every number, subnormals, infinities and not-a-numbers."""
    return np.frombuffer(np.random.default_rng(seed).bytes(count * dtype.itemsize), dtype)


def floats(columns):
    return np.dtype([(name, "<f4") for name in columns])


def save(path, content):
    path.write_bytes(content)
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("ply")


@st.composite
def dtypes(draw):
    """Columns of a 3DGS model in any order, with or without colour and normals, and further ones of any type."""
    columns = dict.fromkeys(CORE, "<f4")
    degree = draw(st.sampled_from([-1, 0, 1, 2, 3]))
    if degree >= 0:
        columns |= {name: "<f4" for name in vanilla_columns(degree) if name.startswith("f_")}
    if draw(st.booleans()):
        columns |= dict.fromkeys(("nx", "ny", "nz"), "<f4")
    further = st.dictionaries(st.from_regex(r"[a-z]{4}_[0-9]", fullmatch=True), st.sampled_from(sorted(PLY_TYPES)))
    columns |= draw(further.filter(lambda names: not names.keys() & columns.keys()))
    return np.dtype(draw(st.permutations(list(columns.items()))))


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_a_vanilla_file_round_trips_byte_for_byte(tmp_path, degree):
    table = random_table(floats(vanilla_columns(degree)), 9)
    content = header(table.dtype, 9, lines=["comment written by a trainer"]) + table.tobytes()
    model = read_model(save(tmp_path / "in.ply", content))
    assert (len(model), model.sh_degree, model.comments) == (9, degree, ("written by a trainer",))
    write_model(tmp_path / "out.ply", model)
    assert (tmp_path / "out.ply").read_bytes() == content


@pytest.mark.parametrize("columns", [[*CORE, *(f"semantic_{i}" for i in range(16))], [*CORE, "filter_3D"]])
def test_a_model_of_a_scheme_without_colour_round_trips_byte_for_byte(tmp_path, columns):
    table = random_table(floats(columns), 4)
    content = header(table.dtype, 4) + table.tobytes()
    model = read_model(save(tmp_path / "in.ply", content))
    assert model.sh_degree == -1
    write_model(tmp_path / "out.ply", model)
    assert (tmp_path / "out.ply").read_bytes() == content


@given(dtype=dtypes(), count=st.integers(1, 5), big_endian=st.booleans(), seed=st.integers(0, 99))
def test_any_layout_is_read_bit_for_bit_and_round_trips(folder, dtype, count, big_endian, seed):
    table = random_table(dtype, count, seed)
    stored = table.astype(dtype.newbyteorder(">")) if big_endian else table
    encoding = "binary_big_endian" if big_endian else "binary_little_endian"
    model = read_model(save(folder / "in.ply", header(dtype, count, encoding) + stored.tobytes()))
    assert model.table.dtype == dtype
    assert model.table.tobytes() == table.tobytes()
    write_model(folder / "out.ply", model)
    assert (folder / "out.ply").read_bytes() == header(dtype, count) + table.tobytes()


@given(dtype=dtypes(), seed=st.integers(0, 99))
def test_ascii_holds_the_same_model_as_binary(folder, dtype, seed):
    table = random_table(dtype, 3, seed)
    rows = "".join(" ".join(map(repr, row)) + "\n" for row in table.tolist())
    read = read_model(save(folder / "text.ply", header(dtype, 3, "ascii") + rows.encode())).table
    assert read.dtype == dtype
    for name in dtype.names:
        np.testing.assert_array_equal(read[name], table[name])  # not-a-numbers are equal here, whatever their bits


@given(keep=st.lists(st.booleans(), min_size=12, max_size=12).filter(any))
def test_a_row_subset_written_and_read_is_bit_identical_to_its_rows(folder, keep):
    table = random_table(floats(vanilla_columns(1)), 12)
    model = read_model(save(folder / "all.ply", header(table.dtype, 12) + table.tobytes()))
    write_model(folder / "some.ply", model[np.array(keep)])
    assert (folder / "some.ply").read_bytes() == header(table.dtype, sum(keep)) + table[keep].tobytes()


@pytest.mark.parametrize("newline", [b"\n", b"\r\n", b"\r"])
def test_header_lines_may_end_in_any_way(tmp_path, newline):
    table = random_table(floats(CORE), 2)
    content = header(table.dtype, 2).replace(b"\n", newline) + table.tobytes()
    assert read_model(save(tmp_path / "m.ply", content)).table.tobytes() == table.tobytes()


def test_a_little_endian_file_is_mapped_and_read_only(tmp_path):
    write_model(tmp_path / "m.ply", blobs(3))
    table = read_model(tmp_path / "m.ply").table
    assert type(table) is np.ndarray
    assert isinstance(table.base, np.memmap)
    assert not table.flags.writeable


def test_a_model_may_replace_the_file_it_is_mapped_from(tmp_path):
    write_model(tmp_path / "m.ply", blobs(9))
    model = read_model(tmp_path / "m.ply")
    before = model.table.tobytes()
    write_model(tmp_path / "m.ply", model[np.arange(9) < 4])
    assert model.table.tobytes() == before
    assert len(read_model(tmp_path / "m.ply")) == 4


def test_elements_after_the_vertices_are_skipped(tmp_path):
    table = random_table(floats(CORE), 2)
    more = b"element face 1\nproperty list uchar int vertex_index\nend_header\n"
    content = header(table.dtype, 2).replace(b"end_header\n", more) + table.tobytes() + b"\x01\x00\x00\x00\x00"
    assert read_model(save(tmp_path / "m.ply", content)).table.tobytes() == table.tobytes()


def test_every_line_of_remark_in_the_header_is_kept_as_a_comment(tmp_path):
    table = random_table(floats(CORE), 1)
    content = header(table.dtype, 1, lines=["comment a", "obj_info b"]).replace(b"vertex 1\n", b"vertex 1\ncomment c\n")
    assert read_model(save(tmp_path / "m.ply", content + table.tobytes())).comments == ("a", "b", "c")


# --- what is refused --------------------------------------------------------------------------------------------------


def refusal(path):
    with pytest.raises(InputError) as caught:
        read_model(path)
    assert caught.value.source == str(path)
    assert "\n" not in str(caught.value)
    return caught.value


@pytest.mark.parametrize("missing", [*CORE, "f_dc_2"])
def test_a_missing_property_is_named(tmp_path, missing):
    columns = [name for name in vanilla_columns(0) if name != missing]
    error = refusal(save(tmp_path / "m.ply", header(floats(columns), 1) + bytes(4 * len(columns))))
    assert (error.field, error.found) == (missing, "no such property")


def test_a_point_cloud_and_a_mesh_are_refused_as_models(tmp_path):
    columns = {"x": "<f4", "y": "<f4", "z": "<f4", "red": "|u1", "green": "|u1", "blue": "|u1"}
    points = header(np.dtype(list(columns.items())), 1)
    error = refusal(save(tmp_path / "input.ply", points + bytes(15)))
    assert (error.field, error.hint) == ("opacity", "a plain point cloud, not a 3DGS model")
    faces = b"element face 0\nproperty list uchar int vertex_indices\nend_header"
    error = refusal(save(tmp_path / "mesh.ply", points.replace(b"end_header", faces) + bytes(15)))
    assert (error.field, error.hint) == ("opacity", "a mesh, not a 3DGS model")


@pytest.mark.parametrize("name", ["x", "rot_3", "f_dc_0", "f_rest_8"])
@pytest.mark.parametrize(("kind", "found"), [("<f8", "float64"), ("|u1", "uint8")])
def test_a_property_of_another_type_is_named(tmp_path, name, kind, found):
    dtype = np.dtype([(column, kind if column == name else "<f4") for column in vanilla_columns(1)])
    error = refusal(save(tmp_path / "m.ply", header(dtype, 1) + bytes(dtype.itemsize)))
    assert (error.field, error.expected, error.found) == (name, "a float32 property", found)


@pytest.mark.parametrize("count", [1, 8, 10, 44, 46, 72])
def test_a_number_of_coefficients_that_fits_no_degree_is_refused(tmp_path, count):
    columns = vanilla_columns(0) + [f"f_rest_{i}" for i in range(count)]
    error = refusal(save(tmp_path / "m.ply", header(floats(columns), 1) + bytes(4 * len(columns))))
    assert (error.field, error.found) == ("f_rest_*", f"{count} properties")


def test_a_gap_in_the_numbers_of_the_coefficients_is_refused(tmp_path):
    columns = [name.replace("f_rest_4", "f_rest_9") for name in vanilla_columns(1)]
    error = refusal(save(tmp_path / "m.ply", header(floats(columns), 1) + bytes(4 * len(columns))))
    assert error.field == "f_rest_4"


@pytest.mark.parametrize("number", ["9" * 5000, "007"])
def test_columns_with_unusual_numbers_are_not_coefficients(tmp_path, number):
    columns = [*vanilla_columns(0), f"f_rest_{number}"]
    model = read_model(save(tmp_path / "m.ply", header(floats(columns), 1) + bytes(4 * len(columns))))
    assert model.sh_degree == 0
    assert model.table.dtype.names[-1] == columns[-1]


@pytest.mark.parametrize("name", ["\x1b[2J", "a:b"])
def test_a_property_name_that_does_not_print_or_cannot_be_written_is_refused(tmp_path, name):
    error = refusal(save(tmp_path / "m.ply", header(floats([*CORE, name]), 1) + bytes(48)))
    assert (error.field, error.expected) == ("property", "a printable name without colons")


def test_coefficients_without_the_zeroth_are_refused(tmp_path):
    columns = CORE + [f"f_rest_{i}" for i in range(9)]
    assert refusal(save(tmp_path / "m.ply", header(floats(columns), 1) + bytes(80))).field == "f_dc_0"


def test_a_list_property_is_refused(tmp_path):
    content = header(floats(CORE), 1).replace(b"end_header", b"property list uchar float sh\nend_header") + bytes(44)
    error = refusal(save(tmp_path / "m.ply", content))
    assert (error.field, error.found) == ("sh", "a list property")


@given(cut=st.integers(1, 3 * 44))
@example(cut=1)
def test_a_truncated_body_is_refused(folder, cut):
    content = header(floats(CORE), 3) + bytes(3 * 44)
    error = refusal(save(folder / "cut.ply", content[:-cut]))
    assert (error.field, error.found) == ("element vertex", f"room for {(3 * 44 - cut) // 44}")


@pytest.mark.parametrize("encoding", ["binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("tail", [b"\0", bytes(44)], ids=["a byte", "a row"])
def test_bytes_after_the_last_element_are_refused(tmp_path, encoding, tail):
    content = header(floats(CORE), 3, encoding) + bytes(3 * 44)
    error = refusal(save(tmp_path / "m.ply", content + tail))
    assert (error.expected, error.found) == (f"{len(content)} bytes", f"{len(content) + len(tail)} bytes")
    more = content.replace(b"end_header\n", b"element camera 1\nproperty uchar id\nend_header\n") + b"\7"
    assert len(read_model(save(tmp_path / "m.ply", more))) == 3
    assert refusal(save(tmp_path / "m.ply", more + tail)).found == f"{len(more) + len(tail)} bytes"


def test_a_row_after_the_last_one_of_an_ascii_file_is_refused(tmp_path):
    content = header(floats(CORE), 2, "ascii") + b"1 2 3 4 5 6 7 8 9 10 11\n" * 3 + b"\n"
    error = refusal(save(tmp_path / "m.ply", content))
    assert (error.field, error.expected) == ("element vertex", "2 rows")


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_a_header_with_more_rows_than_fit_into_memory_is_refused(tmp_path, encoding):
    content = header(floats(CORE), 10**15, encoding) + b"1 " * 11 + b"\n" + bytes(44)
    assert refusal(save(tmp_path / "m.ply", content)).field == "element vertex"


@pytest.mark.parametrize("body", ["", "1 2 3\n", "1 2 3 4 5 6 7 8 9 10 11 12\n", "1 2 3 4 5 6 7 8 9 10 x\n", "é\n"])
def test_an_ascii_body_of_another_shape_is_refused(tmp_path, body):
    error = refusal(save(tmp_path / "m.ply", header(floats(CORE), 1, "ascii") + body.encode()))
    assert error.field == "element vertex"


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_a_model_of_no_gaussians_is_refused(tmp_path, encoding):
    error = refusal(save(tmp_path / "m.ply", header(floats(CORE), 0, encoding)))
    assert (error.field, error.expected, error.found) == ("element vertex", "at least one row", "0 rows")
    with pytest.raises(InputError, match=r"m\.ply: element vertex: expected at least one row"):
        write_model(tmp_path / "m.ply", blobs(1)[np.zeros(1, np.bool_)])


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"solid mesh\n",
        b"ply\n",
        b"ply\nformat binary_little_endian 1.0\n",
        b"ply\nformat binary_middle_endian 1.0\nelement vertex 1\nend_header\n",
        b"ply\nformat ascii 1.0\nelement vertex many\nend_header\n",
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float x\nend_header\n1 2\n",
        b"ply\nformat ascii 1.0\ncomment \xff\nend_header\n",
        b"ply\n" + bytes(3_000_000),
    ],
)
def test_a_file_that_is_not_a_ply_is_refused(tmp_path, content):
    assert refusal(save(tmp_path / "m.ply", content)).field == "file"


def test_a_ply_without_vertices_is_refused(tmp_path):
    face = b"ply\nformat ascii 1.0\nelement face 0\nproperty list uchar int vertex_index\nend_header\n"
    error = refusal(save(tmp_path / "m.ply", face))
    assert (error.field, error.found) == ("element vertex", "face")


def test_a_missing_file_is_refused(tmp_path):
    assert str(refusal(tmp_path / "absent.ply")).endswith("absent.ply: no such file")


def test_a_comment_that_would_break_the_header_is_not_written(tmp_path):
    with pytest.raises(ValueError, match="newline"):
        write_model(tmp_path / "m.ply", blobs(1).with_comment("two\nlines"))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("shades", ["1 1 1", "1.0 1.0", "2.0 0.0 0.0", "1.5 0.0 0.0", "white"])
def test_a_comment_that_names_no_background_is_refused(tmp_path, shades):
    write_model(tmp_path / "m.ply", blobs(1).with_comment(f"gspure background {shades}"))
    assert refusal(tmp_path / "m.ply").field == "comment"


def test_two_backgrounds_are_refused(tmp_path):
    model = blobs(1).with_comment("gspure background 1.0000 1.0000 1.0000")
    write_model(tmp_path / "m.ply", model.with_comment("gspure background 1.0000 1.0000 1.0000"))
    assert read_model(tmp_path / "m.ply").background == (1, 1, 1)
    write_model(tmp_path / "m.ply", model.with_comment("gspure background 0.0000 0.5000 0.0000"))
    assert refusal(tmp_path / "m.ply").expected == "one background"


@pytest.mark.parametrize("comment", ["höhe".encode(), "höhe".encode("latin-1")])
def test_a_comment_that_is_not_ascii_is_named(tmp_path, comment):
    write_model(tmp_path / "m.ply", blobs(1).with_comment("here"))
    content = (tmp_path / "m.ply").read_bytes().replace(b"comment here", b"comment " + comment)
    error = refusal(save(tmp_path / "m.ply", content))
    assert error.expected == "a comment in ASCII in line 3"


# --- fuzzing: a file gives a model or an `InputError`, whatever is in it ----------------------------------------------


def assert_read_or_refused(path):
    try:
        model = read_model(path)
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017
    else:
        assert isinstance(model, Gaussians)
        assert model.means.shape == (len(model), 3)
        assert model.sh_coeffs.shape == (len(model), (model.sh_degree + 1) ** 2, 3)


WORDS = """
    ply format ascii binary_little_endian binary_big_endian 1.0 comment obj_info element vertex face property list float
    double uchar f4 int x y z opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3 f_dc_0 f_rest_0 f_rest_00 chunk
    packed_position end_header 0 1 2 -1 1e400 nan inf 99999999999999999999
"""
words = st.sampled_from(WORDS.split())
lines = st.one_of(
    st.lists(words, max_size=5).map(" ".join),
    st.sampled_from([f"property float {name}" for name in vanilla_columns(1)]),
    st.text(max_size=20),
)


@given(
    encoding=st.sampled_from(["ascii", "binary_little_endian", "binary_big_endian"]),
    core=st.booleans(),
    middle=st.lists(lines, max_size=12),
    newline=st.sampled_from(["\n", "\r\n", "\r"]),
    body=st.one_of(st.binary(max_size=300), st.lists(words, max_size=40).map(lambda row: " ".join(row).encode())),
)
@settings(max_examples=300)
def test_no_header_breaks_the_reader(folder, encoding, core, middle, newline, body):
    start = ["ply", f"format {encoding} 1.0", "element vertex 1"] + [f"property float {name}" for name in CORE if core]
    text = newline.join([*start, *middle, "end_header", ""])
    assert_read_or_refused(save(folder / "fuzz.ply", text.encode() + body))


@given(data=st.data())
@settings(max_examples=300)
def test_no_corruption_of_a_file_breaks_the_reader(folder, data):
    encoding = data.draw(st.sampled_from(["ascii", "binary_little_endian", "binary_big_endian"]))
    body = b"1 2.5 -3e4 0 0 0 0 1 0 0 nan\n" * 2 if encoding == "ascii" else bytes(2 * 44)
    content = bytearray(header(floats(CORE), 2, encoding) + body)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content)))
        end = data.draw(st.integers(at, min(at + 20, len(content))))
        content[at:end] = data.draw(st.binary(max_size=20))
    assert_read_or_refused(save(folder / "fuzz.ply", bytes(content)))


def test_released_pages_are_read_again_as_they_were(tmp_path):
    write_model(tmp_path / "model.ply", blobs(3000))
    model = read_model(tmp_path / "model.ply")
    before = model.table.tobytes()
    model.release_pages()
    assert model.table.tobytes() == before


def test_a_model_in_memory_keeps_its_table():
    model = blobs(3000)
    before = model.table.tobytes()
    model.release_pages()
    assert model.table.tobytes() == before
