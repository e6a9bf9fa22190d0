"""Tensors in PyTorch's files, read and written without PyTorch.

``torch.save`` and TorchScript write a zip archive: raw numbers in ``<root>/data/<key>``, and a pickle,
``<root>/data.pkl``, that describes the tensors. A pickle is a program. It is not executed here: the instructions for
dictionaries and tensors are interpreted, and all others are refused.

PyTorch cannot replace this module: models of SecureGS are rendered, measured, purified and written without it, and
``torch.load(weights_only=True)`` does not read TorchScript, in which Scaffold-GS stores its networks.
"""

import io
import math
import pickletools
import struct
import zipfile
from collections.abc import Callable, Iterator, Mapping
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from gspure.errors import reading
from gspure.files import Float32, replacing

Tensor = NDArray[Any]

DATA_LIMIT: Final = 1 << 16  # largest `data.pkl` in bytes; that of a few networks has some thousand; ours

_LONGEST_NAME: Final = 100
_MOST_AXES: Final = 8

_REBUILD: Final = "torch._utils _rebuild_tensor_v2"
_DICTIONARY: Final = "collections OrderedDict"
_FLOATS: Final = "torch FloatStorage"
_STORAGES: Final = {
    _FLOATS: "<f4",
    "torch DoubleStorage": "<f8",
    "torch HalfStorage": "<f2",
    "torch LongStorage": "<i8",
}
_SCRIPTED: Final = "__torch__."
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
    with reading(path, "a PyTorch archive of tensors"), zipfile.ZipFile(stream or path) as archive:
        return dict(_tensors(_Description(archive).tree(), "", set()))


def write_tensors(path: Path, networks: Mapping[str, Mapping[str, Float32]]) -> None:
    """Write state dicts by name in the format of ``torch.save``; the same tensors give the same bytes."""
    records = [np.ascontiguousarray(array, "<f4") for state in networks.values() for array in state.values()]
    keys = iter(range(len(records)))
    described = {name: {n: _rebuilt(next(keys), a) for n, a in state.items()} for name, state in networks.items()}
    parts = {"data.pkl": b"\x80\x02" + _pushing(described) + b".", "byteorder": b"little", "version": b"3\n"}
    parts |= {f"data/{key}": array.tobytes() for key, array in enumerate(records)}
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as archive:
        for name, content in parts.items():
            archive.writestr(zipfile.ZipInfo(f"{Path(path).stem}/{name}"), content)


class _Description:
    """The pickle of an archive, interpreted with a stack of plain values. It raises an exception for anything else."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        self._archive = archive
        pickles = [name for name in archive.namelist() if name.endswith("/data.pkl") and name.count("/") == 1]
        if len(pickles) != 1:
            raise _refusal(f"{len(pickles)} descriptions data.pkl")
        self._root = pickles[0].removesuffix("data.pkl")
        self._room = archive.start_dir
        self._storages: dict[str, Tensor] = {}
        self._stack: list[Any] = []
        self._memo: dict[int, Any] = {}

    def tree(self) -> Any:
        """Return the nested dictionaries of tensors."""
        for instruction, argument, _ in pickletools.genops(io.BytesIO(self._record("data.pkl", DATA_LIMIT))):
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
            stack[-1].update(zip(map(_named, items[::2]), items[1::2], strict=True))
        elif name == "BUILD":
            state = stack.pop()
            stack[-1].update({_named(key): value for key, value in state.items()})
        elif name == "BINPERSID":
            stack.append(self._storage(*stack.pop()))
        elif name in {"REDUCE", "NEWOBJ"}:
            stack.append(_constructed(name, *self._popped(2)))
        elif name not in {"PROTO", "STOP"}:
            raise _refusal(f"the instruction {name}")

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

    def _storage(self, _kind: Any, numbers: Any, key: Any, _device: Any, count: int) -> Tensor:
        if not isinstance(key, str) or not isinstance(numbers, str) or numbers not in _STORAGES:
            raise _refusal("another storage than of floats or whole numbers")
        if key not in self._storages:
            dtype = np.dtype(_STORAGES[numbers])
            content = self._record(f"data/{key}", dtype.itemsize * count)
            self._storages[key] = np.frombuffer(content, dtype).astype(dtype.newbyteorder("="), copy=False)
        return self._storages[key]

    def _record(self, name: str, limit: int) -> bytes:
        """Return a member of the archive; all of them together are not larger than the file."""
        member = self._archive.getinfo(self._root + name)
        self._room -= member.file_size  # members may overlap
        if member.compress_type != zipfile.ZIP_STORED or member.file_size > limit or self._room < 0:
            raise _refusal(f"{name} compressed, larger than {limit} bytes or overlapping others")
        return self._archive.read(member)


def _refusal(found: str) -> ValueError:
    return ValueError(f"{found}; nothing in it was executed")


def _named(key: Any) -> str:
    """Return the key of a dictionary. It must be a short string: others may take very long to hash or to print."""
    if not isinstance(key, str) or len(key) > _LONGEST_NAME:
        raise _refusal(f"another key than a name of at most {_LONGEST_NAME} characters")
    return key


def _constructed(instruction: str, name: Any, arguments: tuple[Any, ...]) -> Any:
    callee = name if isinstance(name, str) else "another object"
    if (instruction, callee) == ("REDUCE", _REBUILD):
        return _tensor(*arguments[:4])
    scripted = instruction == "NEWOBJ" and callee.startswith(_SCRIPTED)
    if arguments or not (scripted or (instruction, callee) == ("REDUCE", _DICTIONARY)):
        raise _refusal(f"a call of {callee}")
    return {}


def _tensor(storage: Tensor, first: int, shape: tuple[int, ...], strides: tuple[int, ...]) -> Tensor:
    if len(shape) > _MOST_AXES or strides != _dense(shape) or first < 0 or min(shape, default=1) < 1:
        raise _refusal("a tensor that is not dense")
    return storage[first : first + math.prod(shape)].reshape(shape)


def _dense(shape: tuple[int, ...]) -> tuple[int, ...]:
    """Return the strides of a dense tensor, in numbers."""
    return tuple(math.prod(shape[i + 1 :]) for i in range(len(shape)))


def _tensors(tree: Any, prefix: str, visited: set[int]) -> Iterator[tuple[str, Tensor]]:
    """Yield the tensors of nested dictionaries; each dictionary is visited once."""
    if isinstance(tree, np.ndarray):
        yield prefix, tree
    elif isinstance(tree, dict) and id(tree) not in visited:
        visited.add(id(tree))
        for key, value in tree.items():
            yield from _tensors(value, f"{prefix}.{key}" if prefix else key, visited)


def _rebuilt(key: int, array: Float32) -> bytes:
    """Return the instructions for a tensor: ``_rebuild_tensor_v2(storage, 0, shape, strides, False, {})``."""
    storage = _pushing(("storage", _global(_FLOATS), str(key), "cpu", array.size)) + b"Q"
    arguments = (storage, 0, array.shape, _dense(array.shape), b"\x89", _global(_DICTIONARY) + b")R")
    return _global(_REBUILD) + _pushing(arguments) + b"R"


def _pushing(value: Any) -> bytes:
    """Return the instructions, of protocol 2, that push a value; bytes are instructions."""
    match value:
        case bytes():
            return value
        case str():
            return b"X" + struct.pack("<I", len(value.encode())) + value.encode()
        case int():
            return b"J" + struct.pack("<i", value)
        case dict():
            return b"}(" + b"".join(map(_pushing, chain(*value.items()))) + b"u"
    return b"(" + b"".join(map(_pushing, value)) + b"t"


def _global(name: str) -> bytes:
    return "c{}\n{}\n".format(*name.split()).encode()
