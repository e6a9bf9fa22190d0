import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.constants import SH_DC
from gspure.errors import InputError
from gspure.model import read_model, write_model
from tests.models import blobs

CORE = ["x", "y", "z", "opacity", *(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4))]
ENCODINGS = ("ascii", "binary_little_endian", "binary_big_endian")
PLY_TYPES = {"<f4": "float", "<f8": "double", "|u1": "uchar", "|i1": "char", "<u2": "ushort", "<i4": "int"}
FURTHER_TYPES = {"<i2": "short", "<u4": "uint32"}


def vanilla_columns(degree):
    """The columns of the INRIA trainer, in its order."""
    colour = [f"f_dc_{i}" for i in range(3)] + [f"f_rest_{i}" for i in range(3 * (degree + 1) ** 2 - 3)]
    return ["x", "y", "z", "nx", "ny", "nz", *colour, *CORE[3:]]


def header(dtype, count, encoding="binary_little_endian", lines=()):
    """A PLY header in the form that plyfile, and so the INRIA trainer, writes."""
    kinds = PLY_TYPES | FURTHER_TYPES
    properties = [f"property {kinds[dtype[name].newbyteorder('<').str]} {name}" for name in dtype.names]
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


@pytest.mark.parametrize(("text", "value"), [("-nan(ind)", np.nan), ("1.#QNAN0", np.nan), ("-1.#INF", -np.inf)])
def test_numbers_as_windows_writes_them_are_read(folder, text, value):
    dtype = floats(vanilla_columns(0))
    row = f"{text} " + "0.5 " * (len(dtype) - 1)
    model = read_model(save(folder / "windows.ply", header(dtype, 1, "ascii") + row.encode()))
    np.testing.assert_equal(model.means[0, 0], value)


@given(dtype=dtypes(), seed=st.integers(0, 99))
def test_ascii_holds_the_same_model_as_binary(folder, dtype, seed):
    table = random_table(dtype, 3, seed)
    rows = "".join(" ".join(map(repr, row)) + "\n" for row in table.tolist())
    read = read_model(save(folder / "text.ply", header(dtype, 3, "ascii") + rows.encode())).table
    assert read.dtype == dtype
    for name in dtype.names:
        np.testing.assert_array_equal(read[name], table[name])  # not-a-numbers are equal here, whatever their bits


def test_a_model_is_read_only_and_may_replace_the_file_it_was_read_from(tmp_path):
    write_model(tmp_path / "m.ply", blobs(9))
    model = read_model(tmp_path / "m.ply")
    assert not model.table.flags.writeable
    before = model.table.tobytes()
    write_model(tmp_path / "m.ply", model[np.arange(9) < 4])
    assert model.table.tobytes() == before
    assert len(read_model(tmp_path / "m.ply")) == 4


def test_elements_after_the_vertices_are_skipped(tmp_path):
    table = random_table(floats(CORE), 2)
    more = b"element face 1\nproperty list uchar int vertex_index\nend_header\n"
    content = header(table.dtype, 2).replace(b"end_header\n", more) + table.tobytes() + b"\x01\x00\x00\x00\x00"
    assert read_model(save(tmp_path / "m.ply", content)).table.tobytes() == table.tobytes()


def read_with_a_warning(path, capsys):
    """Return a model and the one warning that reading it prints."""
    model = read_model(path)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"warning: {path}: ")
    return model, line


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("kind", sorted((PLY_TYPES | FURTHER_TYPES).keys() - {"<f4"}))
@pytest.mark.parametrize(
    "names", [["x"], ["opacity", "rot_3"], ["f_rest_8", "f_dc_0"], [*vanilla_columns(1), "label_0"]]
)
def test_properties_of_any_number_type_become_float32(tmp_path, capsys, encoding, kind, names):
    columns = [*vanilla_columns(1), "label_0"]
    dtype = np.dtype([(name, kind if name in names else "<f4") for name in columns])
    table = np.ones(4, dtype)
    for i, name in enumerate(columns):
        table[name] = np.arange(i, i + 4)
    body = "\n".join(" ".join(map(str, row)) for row in table.tolist()).encode()
    order = dtype.newbyteorder(">" if "big" in encoding else "<")
    content = header(dtype, 4, encoding) + (body if encoding == "ascii" else table.astype(order).tobytes())
    model, line = read_with_a_warning(save(tmp_path / "m.ply", content), capsys)
    assert {str(np.dtype(kind)), "float32"} <= {*line.replace(",", "").split()}
    for name in columns:
        np.testing.assert_array_equal(model.table[name], table[name])
        kept = name in names and name in {"nx", "ny", "nz", "label_0"}
        assert model.table.dtype[name] == (dtype[name] if kept else np.float32)
    write_model(tmp_path / "out.ply", model)
    assert read_model(tmp_path / "out.ply").table.tobytes() == model.table.tobytes()


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("more", [b"\n\n", b"0123456", b"1 " * 11 + b"\n", bytes(2 * 44), b"\xff" * 1001])
def test_bytes_after_the_last_row_are_not_read(tmp_path, capsys, encoding, more):
    rows = np.full((5, 11), 0.5, ">f4" if "big" in encoding else "<f4")
    body = b"0.5 " * 10 + b"0.5\n" if encoding == "ascii" else rows[0].tobytes()
    path = save(tmp_path / "m.ply", header(floats(CORE), 5, encoding) + 5 * body + more)
    if encoding == "ascii" and not more.strip():
        assert len(read_model(path)) == 5
        return
    model, _ = read_with_a_warning(path, capsys)
    assert model.table.tobytes() == np.full((5, 11), 0.5, "<f4").tobytes()


HEADERS = {
    "blanks": lambda text: text.replace(b"\n", b" \t\n"),
    "blanks between": lambda text: text.replace(b" ", b"\t  "),
    "empty lines": lambda text: text.replace(b"\nproperty", b"\n\n \nproperty"),
    "all, on Windows": lambda text: text.replace(b" ", b"  ").replace(b"\n", b" \r\n").replace(b"e ", b"e  "),
}


@pytest.mark.parametrize("change", HEADERS.values(), ids=HEADERS)
@pytest.mark.parametrize("first", [0x0A, 0x0D, 0x20, 0x41])
def test_blanks_and_empty_lines_in_a_header_are_skipped(tmp_path, capsys, change, first):
    table = np.frombuffer(bytes([first]) * 88, floats(CORE))
    content = change(header(table.dtype, 2)) + table.tobytes()
    assert read_with_a_warning(save(tmp_path / "m.ply", content), capsys)[0].table.tobytes() == table.tobytes()


NOT_NEWLINES = st.binary(max_size=30).filter(lambda text: not {*b"\n\r\0"} & {*text})


@given(comments=st.lists(NOT_NEWLINES, max_size=3))
def test_comments_of_any_encoding_are_kept_byte_for_byte(folder, comments):
    lines = [b"comment " + comment for comment in comments]
    plain, _, rest = of_columns(vanilla_columns(0)).partition(b"element")
    content = plain + b"".join(line + b"\n" for line in lines) + b"element" + rest
    model = read_model(save(folder / "in.ply", content))
    write_model(folder / "out.ply", model.with_comment("één"))
    written = (folder / "out.ply").read_bytes().splitlines()
    assert (folder / "out.ply").read_bytes().startswith(plain + b"".join(line + b"\n" for line in lines))
    assert "comment één".encode() in written


SHADES = {"|u1": (0, 255, 51), "<u2": (0, 65535, 13107), "<f4": (0, 1, 0.2), "<f8": (0, 255, 51), "<i4": (0, 255, 51)}


@pytest.mark.parametrize("kind", SHADES)
def test_red_green_and_blue_become_coefficients(tmp_path, capsys, kind):
    table = np.zeros(3, [*((name, "<f4") for name in CORE), *((name, kind) for name in ("red", "green", "blue"))])
    for name, shade in zip(("red", "green", "blue"), SHADES[kind], strict=True):
        table[name] = shade
    model, line = read_with_a_warning(save(tmp_path / "m.ply", header(table.dtype, 3) + table.tobytes()), capsys)
    assert "red, green, blue" in line
    np.testing.assert_allclose(0.5 + SH_DC * model.sh_coeffs[:, 0], [[0, 1, 0.2]] * 3, atol=1e-6)
    assert model.sh_degree == 0
    assert "red" not in model.names


def test_flat_gaussians_get_a_thin_third_axis(tmp_path, capsys):
    table = np.zeros(3, floats([name for name in vanilla_columns(0) if name != "scale_2"]))
    table["scale_0"] = -1
    table["scale_1"] = -2
    model, line = read_with_a_warning(save(tmp_path / "m.ply", header(table.dtype, 3) + table.tobytes()), capsys)
    np.testing.assert_allclose(model.scales, [np.exp([-1, -2, -2]) * [1, 1, 1e-3]] * 3, rtol=1e-6)
    assert "2DGS" in line


def of_columns(columns, rows=1, encoding="binary_little_endian", body=None):
    """A file of float32 columns, and rows of zeros unless its body is given."""
    return header(floats(columns), rows, encoding) + (bytes(4 * len(columns) * rows) if body is None else body)


WHOLE = of_columns(CORE, 3)
FACES = b"element face 0\nproperty list uchar int vertex_indices\nend_header"
REFUSED = {
    **{f"no {name}": (of_columns([n for n in vanilla_columns(0) if n != name]), name) for name in ("y", "f_dc_2")},
    **{
        f"{n} f_rest": (of_columns(vanilla_columns(0) + [f"f_rest_{i}" for i in range(n)]), "f_rest_*") for n in (1, 72)
    },
    "no f_dc": (of_columns([*CORE, *(f"f_rest_{i}" for i in range(9))]), "f_dc_0"),
    "points": (of_columns(["x", "y", "z"]), "opacity"),
    "a list": (of_columns(CORE).replace(b"end_header", b"property list uchar float sh\nend_header"), "sh"),
    "a row less": (WHOLE[:-44], "element vertex"),
    "no rows": (of_columns(CORE, 0), "element vertex"),
    **{f"too many rows, {e}": (of_columns(CORE, 10**15, e, b"1 " * 11), "element vertex") for e in ENCODINGS},
    "a word in ascii": (of_columns(CORE, 1, "ascii", b"1 " * 10 + b"x\n"), "element vertex"),
    "faces first": (b"ply\nformat ascii 1.0\n" + FACES + b"\n", "element vertex"),
    "nothing": (b"", "file"),
    "another format": (b"ply\nformat binary_middle_endian 1.0\nelement vertex 1\nend_header\n", "file"),
    "bytes": (b"ply\n" + bytes(3_000_000), "file"),
    "a property in another encoding": (WHOLE.replace(b"opacity", b"opacit\xe9"), "file"),
    "no end of the header": (WHOLE[:200], "file"),
}


@pytest.mark.parametrize(("content", "field"), REFUSED.values(), ids=REFUSED)
def test_a_file_is_refused_by_its_field(tmp_path, content, field):
    path = save(tmp_path / "m.ply", content)
    with pytest.raises(InputError) as caught:
        read_model(path)
    assert (caught.value.source, caught.value.field) == (str(path), field)
    assert "\n" not in str(caught.value)


def test_a_model_without_rows_is_not_written(tmp_path):
    with pytest.raises(InputError, match=r"m\.ply: element vertex: expected at least one row"):
        write_model(tmp_path / "m.ply", blobs(1)[np.zeros(1, np.bool_)])
