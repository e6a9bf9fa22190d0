"""Entries of a configuration that stand for several: their ``matrix``, as in a workflow of GitHub Actions."""

from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Annotated, Final

from gspure.codec import read
from gspure.errors import InputError
from gspure.settings import Setting

MATRIX: Final = "matrix"
SECTIONS: Final = ("pairs", "decisions", "variants")

Axes = Annotated[
    Mapping[str, tuple[Setting, ...]],
    "Settings, each with a list of values: in place of this entry, there is one for each combination, NAME_VALUE (with "
    "_ for the point of a number).",
]


def expanded(content: Mapping[str, object], source: str | Path) -> dict[str, object]:
    """Return a configuration in which an entry for each combination replaces an entry with a ``matrix``.

    Raise `InputError` for a ``matrix`` that is none, and for two entries of one name.
    """
    known = dict(content)
    for section in SECTIONS:
        entries = content.get(section)
        if isinstance(entries, Mapping):
            combined = [
                named for name, entry in entries.items() for named in _combinations(section, name, entry, source)
            ]
            if len({name for name, _ in combined}) < len(combined):
                raise InputError(source, section, expected="entries of different names", found="two of one name")
            known[section] = dict(combined)
    return known


def _combinations(section: str, name: str, entry: object, source: str | Path) -> Iterator[tuple[str, object]]:
    """Yield the entries, by their names, for which one entry stands."""
    if not isinstance(entry, Mapping) or MATRIX not in entry:
        yield name, entry
        return
    axes: Mapping[str, tuple[Setting, ...]] = read(Axes, entry[MATRIX], source, f"{section}.{name}.{MATRIX}")
    common = {setting: value for setting, value in entry.items() if setting != MATRIX}
    if section == "variants":
        common.setdefault("attack", name)
    for values in product(*axes.values()):
        words = (str(value).replace(".", "_") for value in values)
        yield "_".join([name, *words]), {**common, **dict(zip(axes, values, strict=True))}
