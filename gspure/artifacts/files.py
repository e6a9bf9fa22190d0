"""Files that are either whole or absent."""

import fcntl
import json
import os
import secrets
import shutil
from collections.abc import Collection, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from fnmatch import fnmatchcase
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, Final

from gspure.artifacts.checksums import distinct, file_checksum, forget, record_file, verify, with_checksum
from gspure.artifacts.replacement import RENDERED, remove_images, require_replaceable
from gspure.errors import InputError, reading


@contextmanager
def replacing(path: Path, *, checksum: bool = False) -> Iterator[Path]:
    """Yield a temporary name beside `path`; on success it replaces `path`, on failure it is removed.

    A reader therefore never sees half a file, and a killed writer leaves the old one in place. The temporary name
    keeps the suffix, since some writers choose their format by it. With `checksum`, the file is never there without its
    checksum. A command replaces only what `require_replaceable` lets it.
    """
    path = Path(path)
    require_replaceable(path, *[record_file(path)] * checksum)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        with _blaming(path, temporary):
            if path.exists() and not (path.is_file() or path.is_dir()):  # root could replace /dev/null
                raise InputError(path, "output", expected="a regular file", found="a device or a pipe")
            yield temporary
            if checksum:
                record = {"artifact": path.name, "bytes": temporary.stat().st_size, "crc32": file_checksum(temporary)}
                write_json(record_file(path), with_checksum(record))
            else:
                forget(path)
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def _blaming(path: Path, temporary: Path) -> Iterator[None]:
    """Let an error about `temporary`, or of the file system about no file (a full disk), name `path`."""
    try:
        yield
    except InputError as error:
        error.source = error.source.replace(str(temporary), str(path))
        raise
    except OSError as error:
        error.filename = str(error.filename or temporary).replace(str(temporary), str(path))
        error.strerror = error.strerror or str(error)
        raise


@contextmanager
def filling(folder: Path, *names: str) -> Iterator[Path]:
    """Yield a temporary folder inside `folder`; on success its files move into `folder`, on failure they are removed.

    So files that belong together appear together or not at all. A new record of images removes those of the old one.

    `names` are all files that may appear, relative to `folder`, exactly or with ``*``; their records may appear, too.
    Those there that may not be replaced (`require_replaceable`), and a folder that cannot be written to, are refused
    before any work is done.
    """
    require_replaceable(*_present(folder, names))
    created = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with _temporary_folder(folder) as temporary, _blaming(folder, temporary):
            yield temporary
            files = sorted(temporary.rglob("*"))  # a record after its file
            targets = {file: folder / file.relative_to(temporary) for file in files if file.is_file()}
            _require_named(folder, names, targets.values())
            require_replaceable(*targets.values())
            remove_images(*(target.parent for target in targets.values() if target.name == RENDERED))
            for target in targets.values():
                forget(target)
                target.parent.mkdir(parents=True, exist_ok=True)
            for file, target in targets.items():
                file.replace(target)
        created.clear()
    finally:
        for path in created:
            with suppress(OSError):  # something else stands in it by now
                path.rmdir()


@contextmanager
def _temporary_folder(folder: Path) -> Iterator[Path]:
    """Yield a folder that is locked while it is in use, and removed then; remove those that killed processes left."""
    for path in folder.glob(f"{_TEMPORARY}*"):
        with suppress(OSError), _locked(path):
            shutil.rmtree(path)
    temporary = folder / f"{_TEMPORARY}{secrets.token_hex(4)}"  # not a process number: they repeat in containers
    unlocked = temporary.with_name(f".{temporary.name}")
    with ExitStack() as stack:
        for path in (temporary, unlocked):
            stack.callback(shutil.rmtree, path, ignore_errors=True)
        with _blaming(folder, unlocked):
            unlocked.mkdir()
            with suppress(OSError):  # a file system without locks, on which no folder counts as left
                stack.enter_context(_locked(unlocked))
            unlocked.rename(temporary)
        yield temporary


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Lock a folder, or raise OSError if another process has, or the file system cannot."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(descriptor)


def _running_system() -> str:
    """Return a name of the running system, which alone knows the locks of its processes; a new one if it has none."""
    with suppress(OSError):
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="utf-8")[:8]
    return secrets.token_hex(4)


_TEMPORARY: Final = f".gspure-{_running_system()}-"


def _present(folder: Path, names: Collection[str]) -> Iterator[Path]:
    """Yield the files of these names, and their records; images have one for all."""
    for name in names:
        for path in folder.glob(name) if "*" in name else [folder / name]:
            if "*" not in name or not path.is_dir():
                yield path
                if not (path.suffix == ".png" and str(Path(name).with_name(RENDERED)) in names):
                    yield record_file(path)


def _require_named(folder: Path, names: Collection[str], files: Iterable[Path]) -> None:
    """Refuse files that the caller of `filling` did not name: they were not checked before the work."""
    patterns = [*names, *(f"{name}.json" for name in names)]
    for name in (file.relative_to(folder).as_posix() for file in files):
        if not any(name == pattern or fnmatchcase(name, pattern) for pattern in patterns):
            raise ValueError(f"{name} is not among the names of the files")


def require_place(path: Path) -> None:
    """Refuse a file that could not be written, before work whose result would be lost."""
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        TemporaryFile(dir=path.parent).close()
    except OSError as error:
        error.filename = str(path)
        raise


def write_text(path: Path, text: str, *, checksum: bool = False) -> None:
    """Write `text` as UTF-8, whole or not at all; with a checksum beside it, if asked to."""
    with replacing(path, checksum=checksum) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, value: Any, *, checksum: bool = False) -> None:
    """Write `value` as indented JSON with sorted keys, as `write_text` does."""
    write_text(path, json.dumps(value, indent=2, sort_keys=True) + "\n", checksum=checksum)


def read_json(path: Path) -> Any:
    """Read JSON, with or without a byte-order mark, or raise `InputError` with the line at which it goes wrong."""
    verify(path)
    with reading(path, "JSON"):
        return json.loads(Path(path).read_text(encoding="utf-8-sig"), object_pairs_hook=distinct)
