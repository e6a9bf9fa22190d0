"""What a long run has found so far, one file per case, so that a run that was stopped goes on where it was."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from gspure.artifacts import write_json

Record = dict[str, Any]


@dataclass(frozen=True)
class Journal:
    """The records of one part, as JSON files in a folder."""

    folder: Path

    def record(self, name: str, make: Callable[..., Record], *arguments: Any) -> Record:
        """Return the record of a case and of the commit; it is made unless it is there."""
        path = self.folder / f"{name.replace('/', '_').replace(' ', '_')}.json"
        if path.is_file():
            found: Record = json.loads(path.read_text(encoding="utf-8"))
            return found
        found = make(*arguments) | {"commit": commit()}
        write_json(path, found)
        return found

    def records(self) -> Iterator[Record]:
        for path in sorted(self.folder.glob("*.json")):
            yield json.loads(path.read_text(encoding="utf-8"))


@cache
def commit() -> str:
    """Return the commit that is checked out, abbreviated."""
    command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "--short", "HEAD"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
