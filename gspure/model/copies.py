"""Copies of models in compressed formats, so that the processes of an audit decode each of them once."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import numpy as np

from gspure.arrays import save_array
from gspure.files import digest, file_state, filling, read_json, write_json
from gspure.model.gaussians import Gaussians
from gspure.model.inria import model_parts

COPIES: Final = "GSPURE_COPIES"  # the environment variable that names their folder; without it, there are none
STORED: Final = Path("stages") / "models"  # that folder in an audit

_ROWS: Final = "rows.npy"
_COMMENTS: Final = "comments.json"


def read_copy(file: Path, decode: Callable[[Path], Gaussians]) -> Gaussians:
    """Return the model of a file, from its copy if there is one of this content, else decoded and then copied."""
    folder = os.environ.get(COPIES)
    if not folder or not file.exists():
        return decode(file)
    states = [f"{part} {file_state(part.stat())}" for part in model_parts(file.absolute())]
    copy = Path(folder) / digest(*states)
    if (copy / _ROWS).is_file():  # it comes last: a killed writer leaves none
        return Gaussians(np.load(copy / _ROWS, allow_pickle=False), tuple(read_json(copy / _COMMENTS)))
    model = decode(file)
    with filling(copy) as temporary:
        save_array(temporary / _ROWS, model.table)
        write_json(temporary / _COMMENTS, model.comments)
    return model


@contextmanager
def copies_in(folder: Path) -> Iterator[None]:
    """Let this process, and those that it starts, use copies in a folder during the block."""
    os.environ[COPIES] = str(folder)
    try:
        yield
    finally:
        del os.environ[COPIES]
