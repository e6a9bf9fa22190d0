"""Tensors in PyTorch's files, read and written without PyTorch.

``torch.save`` and TorchScript write a zip archive: raw numbers in ``<root>/data/<key>``, and a pickle,
``<root>/data.pkl``, that describes the tensors. A pickle is a program. It is not executed here: the instructions for
dictionaries and tensors are interpreted, and all others are refused.

PyTorch cannot replace this module: models of SecureGS are rendered, measured, purified and written without it, and
``torch.load(weights_only=True)`` does not read TorchScript, in which Scaffold-GS stores its networks.
"""

import io
import pickletools
import struct
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from gspure.errors import InputError, reading
from gspure.files import Float32, replacing

Tensor = NDArray[Any]

DATA_LIMIT: Final = 1 << 16  # largest `data.pkl` in bytes; that of a few networks has some thousand; ours

_MOST_AXES: Final = 8
_LONGEST_NAME: Final = 100

_REBUILD = "torch._utils _rebuild_tensor_v2"
_STORAGES: Final = {
    "torch FloatStorage": "<f4",
    "torch DoubleStorage": "<f8",
    "torch HalfStorage": "<f2",
    "torch LongStorage": "<i8",
}
_DICTIONARY = "collections OrderedDict"
_SCRIPTED = "__torch__."
_MARK: Final = object()


_PUSHED: Final[dict[str, Callable[[Any], Any]]] = {
    "MARK": lambda _: _MARK,
    "NONE": lambda _: None,
    "NEWTRUE": lambda _: True,
    "NEWFALSE": lambda _: False,
    "EMPTY_DICT": lambda _: {},
    "EMPTY_TUPLE": lambda _: (),
    **dict.fromkeys(("BININT", "BININT1", "BININT2", "BINUNICODE", "GLOBAL"), lambda argument: argument),
}
"""Instructions that push a value, which depends on their argument; a global pushes its name."""


def read_tensors(path: Path, stream: BinaryIO | None = None) -> dict[str, Tensor]:
    """Read the tensors of a state dict (``.pth``) or a TorchScript module (``.pt``), by dotted name.

    `stream` is the content of the file, if it is in memory. Raise `InputError` if the file is no such archive, or its
    pickle does more than describe dense tensors of numbers.
    """
    with reading(path, "a PyTorch archive"), zipfile.ZipFile(stream or path) as archive:
        return dict(_tensors(_Description(Path(path), archive).tree(), "", set()))


def write_tensors(path: Path, networks: Mapping[str, Mapping[str, Float32]]) -> None:
    """Write state dicts by name in the format of ``torch.save``; the same tensors give the same bytes."""
    records = [array for state in networks.values() for array in state.values()]
    parts = {"data.pkl": _pickled(networks), "byteorder": b"little", "version": b"3\n"}
    parts |= {f"data/{key}": np.ascontiguousarray(array, "<f4").tobytes() for key, array in enumerate(records)}
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as archive:
        for name, content in parts.items():
            archive.writestr(zipfile.ZipInfo(f"{Path(path).stem}/{name}"), content)


class _Description:
    """The pickle of an archive, interpreted with a stack of plain values."""

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self._path = path
        self._archive = archive
        pickles = [name for name in archive.namelist() if name.endswith("/data.pkl") and name.count("/") == 1]
        if len(pickles) != 1:
            raise self._refusal("data.pkl", "one description of tensors", f"{len(pickles)}")
        self._root = pickles[0].removesuffix("data.pkl")
        self._room = archive.start_dir  # overlapping members could be larger than the file
        self._storages: dict[str, Tensor] = {}
        self._stack: list[Any] = []
        self._memo: dict[int, Any] = {}

    def tree(self) -> Any:
        """Return the nested dictionaries of tensors."""
        instructions = pickletools.genops(io.BytesIO(self._record("data.pkl", DATA_LIMIT)))
        with reading(self._path, "a description of tensors"):
            for instruction, argument, _ in instructions:
                self._interpret(instruction.name, argument)
            return self._stack.pop()

    def _interpret(self, name: str, argument: Any) -> None:
        stack = self._stack
        if name in _PUSHED:
            stack.append(_PUSHED[name](argument))
        elif name in {"BINPUT", "LONG_BINPUT"}:
            self._memo[argument] = stack[-1]
        elif name in {"BINGET", "LONG_BINGET"}:
            stack.append(self._memo[argument])
        elif name in {"TUPLE", "TUPLE1", "TUPLE2", "TUPLE3"}:
            stack.append(tuple(self._popped(self._above_mark() if name == "TUPLE" else int(name[-1]))))
        elif name in {"SETITEM", "SETITEMS"}:
            items = self._popped(self._above_mark() if name == "SETITEMS" else 2)
            stack[-1].update(zip(map(self._named, items[::2]), items[1::2], strict=True))
        elif name == "BUILD":
            (state,) = self._popped(1)
            stack[-1].update({self._named(key): value for key, value in state.items()})
        elif name == "BINPERSID":
            stack.append(self._storage(*stack.pop()))
        elif name in {"REDUCE", "NEWOBJ"}:
            stack.append(self._constructed(name, *self._popped(2)))
        elif name not in {"PROTO", "STOP"}:
            raise self._refusal("pickle", "a description of tensors", f"the instruction {name}")

    def _above_mark(self) -> int:
        """Remove the topmost mark and return the number of items above it."""
        index = next(i for i in reversed(range(len(self._stack))) if self._stack[i] is _MARK)
        del self._stack[index]
        return len(self._stack) - index

    def _popped(self, count: int) -> list[Any]:
        first = len(self._stack) - count
        items = self._stack[first:]
        del self._stack[first:]
        return items

    def _named(self, key: Any) -> str:
        """Return the key of a dictionary. It must be a short string: others may take very long to hash or to print."""
        if not isinstance(key, str) or len(key) > _LONGEST_NAME:
            raise self._refusal("pickle", f"names of at most {_LONGEST_NAME} characters", "another key")
        return key

    def _constructed(self, instruction: str, name: Any, arguments: tuple[Any, ...]) -> Any:
        if isinstance(name, str):
            module = instruction == "NEWOBJ" and name.startswith(_SCRIPTED)
            if not arguments and (module or (instruction == "REDUCE" and name == _DICTIONARY)):
                return {}
            if instruction == "REDUCE" and name == _REBUILD:
                return self._tensor(*arguments[:4])
        callee = name if isinstance(name, str) else "another object"
        raise self._refusal("pickle", "tensors, dictionaries and modules", f"a call of {callee}")

    def _storage(self, kind: Any, numbers: Any, key: Any, _device: Any, count: int) -> Tensor:
        if kind != "storage" or not isinstance(key, str) or not isinstance(numbers, str) or numbers not in _STORAGES:
            raise self._refusal("tensor", f"one of {', '.join(_STORAGES)}", "another storage")
        if key not in self._storages:
            dtype = np.dtype(_STORAGES[numbers])
            content = self._record(f"data/{key}", dtype.itemsize * count)
            if len(content) != dtype.itemsize * count:
                raise self._refusal(f"data/{key}", f"{count} numbers", f"{len(content)} bytes")
            self._storages[key] = np.frombuffer(content, dtype).astype(dtype.newbyteorder("="), copy=False)
        return self._storages[key]

    def _tensor(self, storage: Tensor, first: int, shape: tuple[int, ...], strides: tuple[int, ...]) -> Tensor:
        if not all(isinstance(n, int) for n in (first, *shape, *strides)) or len(shape) > _MOST_AXES:
            raise self._refusal("tensor", f"a shape of at most {_MOST_AXES} whole numbers", "another")
        count = int(np.prod(shape, dtype=object))
        dense = tuple(int(np.prod(shape[i + 1 :], dtype=object)) for i in range(len(shape)))
        if strides != dense or first < 0 or min(shape, default=1) < 1 or first + count > len(storage):
            raise self._refusal("tensor", f"a dense part of {len(storage)} numbers", f"{shape} from {first}, {strides}")
        return storage[first : first + count].reshape(shape)

    def _record(self, name: str, limit: int) -> bytes:
        """Return a member of the archive, which must be uncompressed, so that it is not larger than the file."""
        with reading(self._path, f"a member {name}"):
            member = self._archive.getinfo(self._root + name)
            if member.compress_type != zipfile.ZIP_STORED or member.file_size > limit:
                found = f"{member.file_size} bytes, compressed" if member.compress_type else f"{member.file_size} bytes"
                raise self._refusal(name, f"at most {limit} bytes, uncompressed", found)
            self._room -= member.file_size
            if self._room < 0:
                raise self._refusal(name, "disjoint members", "overlapping ones")
            return self._archive.read(member)

    def _refusal(self, field: str, expected: str, found: str) -> InputError:
        return InputError(self._path, field, expected=expected, found=found, hint="nothing in it was executed")


def _tensors(tree: Any, prefix: str, visited: set[int]) -> Iterator[tuple[str, Tensor]]:
    """Yield the tensors of nested dictionaries; each dictionary is visited once."""
    if isinstance(tree, np.ndarray):
        yield prefix, tree
    elif isinstance(tree, dict) and id(tree) not in visited:
        visited.add(id(tree))
        for key, value in tree.items():
            yield from _tensors(value, f"{prefix}.{key}" if prefix else key, visited)


def _pickled(networks: Mapping[str, Mapping[str, Float32]]) -> bytes:
    """Return the pickle, protocol 2, of a dictionary of state dicts whose storages are numbered in order."""
    keys = iter(range(sum(map(len, networks.values()))))
    states = b"".join(
        _text(name) + b"}(" + b"".join(_text(n) + _rebuilt(next(keys), array) for n, array in state.items()) + b"u"
        for name, state in networks.items()
    )
    return b"\x80\x02}(" + states + b"u."


def _rebuilt(key: int, array: Float32) -> bytes:
    """Return the instructions for a tensor: ``_rebuild_tensor_v2(storage, 0, shape, strides, False, {})``."""
    kind = _text("storage") + _global("torch FloatStorage")
    storage = b"(" + kind + _text(str(key)) + _text("cpu") + _integer(array.size) + b"tQ"
    strides = [array[..., None][(0,) * (i + 1)].size for i in range(array.ndim)]
    numbers = b"".join(b"(" + b"".join(map(_integer, axis)) + b"t" for axis in (array.shape, strides))
    return _global(_REBUILD) + b"(" + storage + _integer(0) + numbers + b"\x89" + _global(_DICTIONARY) + b")RtR"


def _text(text: str) -> bytes:
    return b"X" + struct.pack("<I", len(text.encode())) + text.encode()


def _integer(number: int) -> bytes:
    return b"J" + struct.pack("<i", number)


def _global(name: str) -> bytes:
    module, _, attribute = name.partition(" ")
    return f"c{module}\n{attribute}\n".encode()
