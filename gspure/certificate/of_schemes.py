"""The checks of a scheme: it is trained on a small pair, published, read back, and read with wrong keys."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import filter as matching
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from gspure.attacks import find_attack
from gspure.certificate.check import Check, check, name_check, require
from gspure.errors import InputError
from gspure.public_model import PublicModel
from gspure.schemes.pair import Pair
from gspure.schemes.readability import Readability, readability_of
from gspure.schemes.scheme import Key, Scheme, hide
from gspure.settings import Setting


@dataclass(frozen=True)
class Embedded:
    """A scheme, a pair, and what the scheme made of it."""

    scheme: Scheme
    pair: Pair
    settings: Mapping[str, Setting]
    public: PublicModel
    key: Key

    @cached_property
    def reading(self) -> Readability:
        """How much of the message the key reads."""
        return self.read_from(self.public, self.key)

    def read_from(self, public: PublicModel, key: Key) -> Readability:
        """Return how much of the message a key reads in a model."""
        return readability_of(self.scheme, self.pair, public, key)

    def written(self, folder: Path) -> dict[str, bytes]:
        """Write model and key, and return the content of their files by name."""
        self.public.write(folder / "public" / "point_cloud.ply")
        (folder / "key").mkdir()
        self.key.write(folder / "key")
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        return {str(file.relative_to(folder)): file.read_bytes() for file in files}


def scheme_checks(scheme: Scheme, pair: Pair, settings: Mapping[str, Setting], folder: Path) -> Iterator[Check]:
    """Yield the checks of a scheme, which is trained three times with these settings; files go to an empty folder."""
    made: list[Embedded] = []
    yield name_check(scheme.name)
    yield check("embeds a message, and returns its key", lambda: made.append(embedded(scheme, pair, settings)))
    if not made:
        return
    (first,) = made
    files = first.written(folder / "first")
    yield check("declares columns that its file has", lambda: _declares_columns(first))
    yield check("reads its files back", lambda: _reads_back(first, folder))
    yield check("gives the same files with the same seed", lambda: _repeats(first, files, folder))
    yield check("refuses a folder without its files", lambda: _refuses(first, folder))
    yield check("trains a clean model without a key", lambda: _trains_clean(first))
    yield check("reads its message", lambda: _reads(first), is_rule=False)
    yield check("reads its message from reordered rows", lambda: _reads_reordered(first), is_rule=False)
    yield check("hides its message from a wrong key", lambda: _hides(first), is_rule=False)


def embedded(scheme: Scheme, pair: Pair, settings: Mapping[str, Setting]) -> Embedded:
    """Train a scheme on a pair."""
    arguments: dict[str, Any] = dict(settings)
    public, key = hide(scheme, pair, **arguments)
    if key is None:
        raise InputError(f"scheme {scheme.name}", "key", expected="one beside the public model", found="none")
    return Embedded(scheme, pair, settings, public, key)


def _declares_columns(first: Embedded) -> None:
    names = first.public.model.names
    for patterns in (*first.scheme.extractions.values(), first.scheme.signature, first.scheme.carriers):
        for pattern in patterns:
            require(bool(matching(names, pattern)), f"{pattern} is no column of the public model")


def _reads_back(first: Embedded, folder: Path) -> None:
    public = first.scheme.read_public(folder / "first" / "public" / "point_cloud.ply")
    key = first.scheme.read_key(folder / "first" / "key")
    require(np.array_equal(public.model.table, first.public.model.table), "rows differ after reading")
    view = first.pair.scene.views[0]
    before = first.public.scene()(view)
    after = public.scene()(view)
    require(np.array_equal(before, after), "renders differ after reading")
    written = first.reading.message
    read = first.read_from(public, key).message
    require(read == written, f"the key reads {read:.0f} % of the message after reading, {written:.0f} % before")


def _repeats(first: Embedded, files: Mapping[str, bytes], folder: Path) -> None:
    again = embedded(first.scheme, first.pair, first.settings).written(folder / "again")
    changed = [name for name in {*files, *again} if files.get(name) != again.get(name)]
    require(not changed, f"{', '.join(sorted(changed))} differ")


def _refuses(first: Embedded, folder: Path) -> None:
    empty = folder / "empty"
    empty.mkdir()
    for read in (first.scheme.read_public, first.scheme.read_key):
        try:
            read(empty)
        except (InputError, OSError):
            continue
        require(holds=False, problem="an empty folder is read as a model or a key")


def _trains_clean(first: Embedded) -> None:
    arguments: dict[str, Any] = {**first.settings, "message_weight": 0}
    public, key = hide(first.scheme, first.pair, **arguments)
    require(key is None, "with message_weight=0, there is a key")
    require(public.model.names == first.public.model.names, "the clean model has other columns")


def _reads(first: Embedded) -> None:
    found = first.reading
    require(found.readable, f"{found.quantity} {found.message:.0f} %: perhaps too few steps")


def _reads_reordered(first: Embedded) -> None:
    before = first.reading
    attacked = find_attack("reorder").apply(first.public)
    after = first.read_from(attacked.published(first.public), first.key)
    require(after.message >= before.message - 1.0, f"{before.quantity} {before.message:.0f} % → {after.message:.0f} %")


def _hides(first: Embedded) -> None:
    found = first.reading
    wrong = max(found.controls.values())
    require(
        wrong < found.message,
        f"{found.quantity} with a wrong key {wrong:.0f} %, with the right one {found.message:.0f} %",
    )
