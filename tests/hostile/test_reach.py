"""No file is forgotten: readers open what they corrupt, and every function that parses a file has a reader."""

import ast
import os
import sys
from pathlib import Path

import pytest

from tests.hostile.readers import READERS

ROOT = Path(__file__).parents[2]
PARSERS = {"ZipFile", "load", "loads", "mmap", "read_bytes", "read_text", "safe_load"}
PARSERS |= {"load_array", "load_arrays", "read_json", "read_table"}
COMMANDS = {"cli", "report"}
"""Packages of commands: `tests.hostile.corruption` runs each on forgeries of everything that its job reads."""

WITHOUT_READER = {
    "artifacts/files.py:_running_system": "of the operating system",
    "evaluation/detection.py:_answer": "the output of a program",
    "method/contributions.py:_content": "in the package",
    "method/contributions.py:rendering_digest": "in the package",
    "model/compressed/writing.py:_write_spz": "its own temporary file",
    "opencl/program.py:kernel_source": "in the package",
    "plugins.py:_load": "entry points",
    "schemes/gs_hider/public_model.py:FeatureModel.has_networks": "bytes, only compared",
    "schemes/scheme.py:_files": "its own temporary files",
    "schemes/tensors.py:write_tensors": "writes",
    "trial.py:try_devices": "the output of a program",
    "workflow/job_progress.py:Job.logged": "the log of a running job",
    "workflow/options.py:profile_options": "in the package",
    "workflow/sources.py:_imports": "in the package",
    "workflow/sources.py:code_digest": "in the package",
}
"""Functions that parse what no user and no job writes."""

OPTIONAL = {"schemes/gs_hider/decoder_file.py:DecoderFile.read"}
"""Functions whose readers need an optional package."""


@pytest.fixture(scope="module")
def reached(tmp_path_factory):
    """The files that each reader opens, and the functions of the package that all readers call."""
    opened: dict[str, set[str]] = {reader.name: set() for reader in READERS if reader.available}
    functions: set[str] = set()
    reading: list[tuple[str, Path]] = []

    def note_file(event, arguments):
        if event == "open" and reading and isinstance(arguments[0], str | os.PathLike):
            name, folder = reading[0]
            opened[name].add(os.path.relpath(arguments[0], folder))

    def note_function(frame, event, _):
        if event == "call":
            functions.add(f"{frame.f_code.co_filename.rpartition('/gspure/')[2]}:{frame.f_code.co_qualname}")

    sys.addaudithook(note_file)
    for reader in READERS:
        if reader.available:
            folder = tmp_path_factory.mktemp("reader").resolve()
            reader.build(folder)
            reading.append((reader.name, folder))
            sys.setprofile(note_function)
            try:
                reader.read(folder)
            finally:
                sys.setprofile(None)
                reading.clear()
    return opened, functions


def test_readers_open_every_file_that_they_corrupt(reached):
    opened, _ = reached
    unopened = {r.name: missing for r in READERS if r.available and (missing := r.targets.keys() - opened[r.name])}
    assert unopened == {}


def test_every_function_that_parses_a_file_has_a_reader(reached):
    _, functions = reached
    parsing = {*parsing_functions()}
    assert WITHOUT_READER.keys() <= parsing, "a name has changed"
    assert parsing - functions - WITHOUT_READER.keys() - OPTIONAL == set()


def parsing_functions():
    for file in sorted((ROOT / "gspure").rglob("*.py")):
        path = file.relative_to(ROOT / "gspure")
        if path.parts[0] not in COMMANDS:
            for name, function in functions_of(ast.parse(file.read_text())):
                calls = (node.func for node in ast.walk(function) if isinstance(node, ast.Call))
                if PARSERS & {
                    call.attr if isinstance(call, ast.Attribute) else getattr(call, "id", "") for call in calls
                }:
                    yield f"{path}:{name}"


def functions_of(node, prefix=""):
    for child in node.body:
        if isinstance(child, ast.FunctionDef):
            yield prefix + child.name, child
        elif isinstance(child, ast.ClassDef):
            yield from functions_of(child, f"{prefix}{child.name}.")
