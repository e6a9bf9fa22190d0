"""The start of a step: a script of ``rules/steps``, which a rule runs with two arguments, JSON objects."""

import gc
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_type_hints

from gspure.errors import InputError, error_line
from gspure.progress import tell, warnings_in_lines


def run(function: Callable[..., None]) -> None:
    """Call `function` with the entries of the JSON objects by name, as paths where it wants paths.

    On bad input, end with exit status 2 and one line: the last one of the log is the reason of a failure.
    """
    hints, texts = get_type_hints(function), sys.argv[1:]
    arguments = {name: _typed(value, hints.get(name)) for text in texts for name, value in json.loads(text).items()}
    try:
        with warnings_in_lines():
            function(**arguments)
    except (InputError, MemoryError, OSError) as error:
        tell(f"gspure {Path(sys.argv[0]).stem}: {error_line(error)}")
        sys.exit(2)
    gc.freeze()  # as `gspure.__main__` does


def _typed(value: Any, hint: Any) -> Any:
    if hint == list[Path]:
        return [Path(path) for path in ([value] if isinstance(value, str) else value)]
    return Path(value) if hint in (Path, Path | None) and value else value
