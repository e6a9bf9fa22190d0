"""Digests by which the workflow knows what to run again: of the code behind a result, and of the user's files."""

import os
import re
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from importlib.util import find_spec, resolve_name
from pathlib import Path
from typing import Any, Final

from gspure.errors import InputError
from gspure.files import digest, file_digest, file_state, read_json, write_json
from gspure.opencl.program import kernel_digest
from gspure.plugins import installed

_PACKAGE: Final = Path(__file__).parents[1]
_DIGESTS: Final = Path(".snakemake") / "gspure-digests.json"  # state and digest of the user's files, by name
_INPUTS: Final = Path(".snakemake") / "gspure-inputs.json"  # the same of all files of this run, when it began
_COMMENT: Final = re.compile("#.*")
_IMPORT: Final = re.compile(
    r"(?:^|[;:])[ \t]*(?:from[ \t]+([\w.]+)[ \t]+)?import\b[ \t]*(\([^)]*\)|[^\n;]*)", re.MULTILINE
)
_SETTLED: Final = 2_000_000_000  # nanoseconds after which a further change gives a file another time; ours

_noted: dict[str, Any] = {}  # state and digest of the files that `note_inputs` noted in this process


def note_inputs(files: Iterable[str | Path]) -> None:
    """Let `files_digest` name the content that files have now until this process ends."""
    _noted.update(_entries(files))


def write_inputs() -> None:
    """Write down the noted files, for `require_inputs`."""
    write_json(_INPUTS, _noted)


def require_inputs() -> None:
    """Refuse files that changed after the run noted them: its results would be of several contents."""
    noted = read_json(_INPUTS) if _INPUTS.is_file() else {}
    for name, (state, content) in noted.items():
        file = Path(name)
        if [*file_state(file.stat())] != state and file_digest(file) != content:
            raise InputError(name, "file", expected="its content when this run began", found="another: run it again")


def files_digest(files: Iterable[str | Path]) -> str:
    """Return a digest of the names and contents of the files that exist, noted or as they are now."""
    return digest(*(f"{name} {content}" for name, (_, content) in _entries(files)))


def _entries(files: Iterable[str | Path]) -> list[tuple[str, Any]]:
    """Return the names of the files that exist, with their state and digest.

    A file is read once: later runs know its digest by its size, times and inode.
    """
    known = _known_digests()
    names = [str(file) for file in files if Path(file).is_file()]
    states = {name: [*file_state(os.stat(name))] for name in names}  # noqa: PTH116 -- names are texts in the store
    changed = [name for name in states if known.get(name, [[]])[0] != states[name]]
    for name in changed:
        known[name] = [states[name], file_digest(Path(name))]
    if changed:
        now = time.time_ns()
        settled = {name: entry for name, entry in known.items() if now - entry[0][2] > _SETTLED}
        with suppress(OSError):
            write_json(_DIGESTS, settled)
    return [(name, _noted.get(name) or known[name]) for name in names]


@cache
def _known_digests() -> dict[str, Any]:
    """Return the digests that earlier runs stored."""
    try:
        return dict(read_json(_DIGESTS))
    except InputError:
        return {}


def code_digest(*sources: str | Path) -> str:
    """Return a digest of the source of modules and scripts, and of all that these import, at any depth.

    Only sources of this package and of those with plug-ins count, also those imported inside functions, and with
    `gspure.opencl` the kernels. This package's ``__init__`` does not count: it only names the public functions.
    """
    scripts = [source for source in sources if isinstance(source, Path)]
    known = {source for source in sources if isinstance(source, str)}
    for script in scripts:
        known |= {name for name in _named(script.read_bytes(), []) if name.startswith("gspure.") and _file(name)}
    waiting = [*known]
    while waiting:
        new = _imports(waiting.pop()) - known
        known |= new
        waiting += new
    kernels = kernel_digest() if "gspure.opencl" in known else ""
    return digest(kernels, *(file.read_bytes() for file in [*scripts, *filter(None, map(_file, sorted(known)))]))


@cache
def _imports(module: str) -> frozenset[str]:
    if not (file := _file(module)):
        return frozenset()
    parents = module.split(".")
    names = _named(file.read_bytes(), parents if file.name == "__init__.py" else parents[:-1])
    packages = {"gspure", parents[0], *(entry.module.split(".")[0] for entry in installed())}
    return frozenset(name for name in names if name != "gspure" and name.split(".")[0] in packages and _file(name))


def _named(source: bytes, parents: list[str]) -> Iterator[str]:
    """Yield the modules that a source imports, and the names imported from them, which may be modules too.

    Examples in texts count as well; Python's own parser would take a second for all modules.
    """
    code = _COMMENT.sub("", source.decode(errors="replace")).replace("\\\n", " ")
    for module, imported in _IMPORT.findall(code):
        names = [words.split()[0] for words in imported.strip("()").split(",") if words.strip()]
        if not module:
            yield from names
            continue
        with suppress(ImportError):  # `from ... import`, in a text
            origin = resolve_name(module, ".".join(parents))
            yield from (origin, *(f"{origin}.{name}" for name in names))


@cache
def _file(module: str) -> Path | None:
    """Return the source of a module; None without one."""
    top, *inner = module.split(".")
    if top == "gspure":
        home = _PACKAGE
    elif (spec := find_spec(top)) is None:
        return None
    elif spec.submodule_search_locations:
        home = Path(spec.submodule_search_locations[0])
    else:
        home = Path(spec.origin or top).with_suffix("")
    path = home.joinpath(*inner)
    source = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return source if source.exists() else None
