"""The start of a step: a script of ``rules/steps``, which a rule runs with JSON objects as arguments."""

import gc
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import get_type_hints

from gspure.codec import read
from gspure.errors import InputError, error_line
from gspure.progress import tell, warnings_in_lines
from gspure.workflow.sources import require_inputs


def run(function: Callable[..., None]) -> None:
    """Call `function` with the entries of the JSON objects by name, decoded by its type hints.

    On bad input, end with exit status 2 and one line: the last one of the log is the reason of a failure. The user's
    files count as bad if they changed after the run began.
    """
    hints = get_type_hints(function, include_extras=True)
    arguments = {}
    for text in sys.argv[1:]:
        for name, value in json.loads(text).items():
            arguments[name] = read(hints[name], value, Path(sys.argv[0]).stem, name)
    try:
        with warnings_in_lines():
            require_inputs()
            function(**arguments)
            require_inputs()
    except (InputError, MemoryError, OSError) as error:
        tell(f"gspure {Path(sys.argv[0]).stem}: {error_line(error)}")
        sys.exit(2)
    gc.freeze()  # as `gspure.__main__` does
