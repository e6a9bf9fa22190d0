import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gspure.errors import InputError
from gspure.model import read_model, write_model
from tests.models import blobs

CORE = ["x", "y", "z", "opacity", *(f"scale_{i}" for i in range(3)), *(f"rot_{i}" for i in range(4))]
ENCODINGS = ("ascii", "binary_little_endian", "binary_big_endian")
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


def test_header_lines_may_end_as_on_windows(tmp_path):
    table = random_table(floats(CORE), 2)
    content = header(table.dtype, 2).replace(b"\n", b"\r\n") + table.tobytes()
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


# --- what is refused --------------------------------------------------------------------------------------------------


def refusal(path):
    with pytest.raises(InputError) as caught:
        read_model(path)
    assert caught.value.source == str(path)
    assert "\n" not in str(caught.value)
    return caught.value


def of_columns(columns, rows=1, encoding="binary_little_endian", body=None):
    """A file of float32 columns, and rows of zeros unless its body is given."""
    return header(floats(columns), rows, encoding) + (bytes(4 * len(columns) * rows) if body is None else body)


def of_kind(name, kind):
    dtype = np.dtype([(column, kind if column == name else "<f4") for column in vanilla_columns(1)])
    return header(dtype, 1) + bytes(dtype.itemsize)


WHOLE = of_columns(CORE, 3)
FACES = b"element face 0\nproperty list uchar int vertex_indices\nend_header"
REFUSED = {
    **{f"no {name}": (of_columns([n for n in vanilla_columns(0) if n != name]), name) for name in ("y", "f_dc_2")},
    **{f"{name} as {kind}": (of_kind(name, kind), name) for name in ("x", "f_rest_8") for kind in ("<f8", "|u1")},
    **{
        f"{n} f_rest": (of_columns(vanilla_columns(0) + [f"f_rest_{i}" for i in range(n)]), "f_rest_*") for n in (1, 72)
    },
    "no f_dc": (of_columns([*CORE, *(f"f_rest_{i}" for i in range(9))]), "f_dc_0"),
    "points": (of_columns(["x", "y", "z"]), "opacity"),
    "a mesh": (of_columns(["x", "y", "z"]).replace(b"end_header", FACES), "opacity"),
    "a list": (of_columns(CORE).replace(b"end_header", b"property list uchar float sh\nend_header"), "sh"),
    "a row less": (WHOLE[:-44], "element vertex"),
    "a byte more": (WHOLE + b"\0", "file"),
    "no rows": (of_columns(CORE, 0), "element vertex"),
    **{f"too many rows, {e}": (of_columns(CORE, 10**15, e, b"1 " * 11), "element vertex") for e in ENCODINGS},
    "a word in ascii": (of_columns(CORE, 1, "ascii", b"1 " * 10 + b"x\n"), "element vertex"),
    "a row more in ascii": (of_columns(CORE, 1, "ascii", b"1 " * 11 + b"\n" + b"1 " * 11), "element vertex"),
    "faces first": (b"ply\nformat ascii 1.0\n" + FACES + b"\n", "element vertex"),
    "nothing": (b"", "file"),
    "another format": (b"ply\nformat binary_middle_endian 1.0\nelement vertex 1\nend_header\n", "file"),
    "bytes": (b"ply\n" + bytes(3_000_000), "file"),
    "a comment in another encoding": (WHOLE.replace(b"end_header", b"comment \xff\nend_header"), "file"),
}


@pytest.mark.parametrize(("content", "field"), REFUSED.values(), ids=REFUSED)
def test_a_file_is_refused_by_its_field(tmp_path, content, field):
    assert refusal(save(tmp_path / "m.ply", content)).field == field


def test_a_missing_file_and_a_model_without_rows_are_refused(tmp_path):
    assert str(refusal(tmp_path / "absent.ply")).endswith("absent.ply: no such file")
    with pytest.raises(InputError, match=r"m\.ply: element vertex: expected at least one row"):
        write_model(tmp_path / "m.ply", blobs(1)[np.zeros(1, np.bool_)])
