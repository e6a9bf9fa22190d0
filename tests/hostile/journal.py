"""The records of a long run, one file per case, so that a run that was stopped goes on where it was.

The records of a part that ran to its end are kept in the repository, one JSON file per part and one line per case; the
page is written from them.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from gspure.artifacts import read_json, write_json, write_text

Record = dict[str, Any]

KEPT = Path(__file__).parents[2] / "benchmarks" / "torture"
"""The records of the last run of each part."""

PRINTED = "printed"
"""What a job printed: in the records of a run, not in those that are kept."""


@dataclass(frozen=True)
class Journal:
    """The records of one part, as JSON files in a folder."""

    folder: Path

    def record(self, name: str, make: Callable[..., Record], *arguments: Any) -> Record:
        """Return the record of a case and of the commit; it is written unless it is there."""
        path = self.folder / f"{name.replace('/', '_').replace(' ', '_')}.json"
        if path.is_file():
            record: Record = json.loads(path.read_text(encoding="utf-8"))
            return record
        record = make(*arguments) | {"commit": commit()}
        write_json(path, record)
        return record


CASE = ("reader", "rule", "kind", "file", "case", "module", "driver", "style")
"""The entries that name a case."""


def case_of(record: Record) -> tuple[Any, ...]:
    """Return what names the case of a record; those of a reader at several commits add up."""
    return *(record.get(name) for name in CASE), "reader" in record and record["commit"]


def keep(part: str, records: Iterable[Record], *, partial: bool = False) -> None:
    """Keep the records of a part; if it was run partially, those of cases that did not run again stay."""
    every = [*(kept(part) if partial else ()), *records]
    cases = {case_of(record): record for record in every}
    records = [cases[case] for case in sorted(cases, key=str)]
    lines = [json.dumps({k: v for k, v in record.items() if k != PRINTED}, sort_keys=True) for record in records]
    write_text(KEPT / f"{part}.json", "[\n" + ",\n".join(lines) + "\n]\n")


def kept(part: str) -> list[Record]:
    """Return the records of the last run of a part; none if it never ran."""
    file = KEPT / f"{part}.json"
    records: list[Record] = read_json(file) if file.is_file() else []
    return records


@cache
def commit() -> str:
    """Return the commit that is checked out, abbreviated."""
    command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "--short", "HEAD"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
