"""The start of a step: arguments as JSON objects, and bad input as one line."""

import gc
import json
import warnings
from pathlib import Path
from typing import Annotated

import pytest

from gspure.errors import InputError
from gspure.evaluation.plan import Detector
from gspure.settings import Range
from gspure.workflow.step import run


@pytest.fixture
def arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = {"detector": {"command": "read"}, "limit": 3}
    files = {"model": "a/b.ply"}
    monkeypatch.setattr("sys.argv", ["rules/steps/sketch.py", json.dumps(settings), json.dumps(files)])


def test_a_step_gets_the_entries_of_all_objects_as_values_of_its_types(arguments: None) -> None:
    calls = []

    def sketch(model: Path, detector: Detector, limit: float, missing: Path | None = None) -> None:
        calls.append((model, detector, limit, missing))

    run(sketch)
    assert repr(calls) == repr([(Path("a/b.ply"), Detector("read"), 3.0, None)])


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (InputError("a.ply", "x", expected="a number", found="none"), "a.ply: x: expected a number, found none"),
        (MemoryError("too large"), "out of memory: too large"),
        (FileNotFoundError(2, "No such file", "a.ply"), "a.ply: No such file"),
    ],
    ids=["input", "memory", "file"],
)
def test_a_refusal_is_the_last_line_and_status_2(
    arguments: None, capsys: pytest.CaptureFixture[str], error: Exception, line: str
) -> None:
    def sketch(model: Path, detector: Detector, limit: float) -> None:
        raise error

    with pytest.raises(SystemExit) as end:
        run(sketch)
    assert end.value.code == 2
    assert capsys.readouterr().err == f"gspure sketch: {line}\n"


@pytest.mark.filterwarnings("default")
def test_a_warning_is_a_line(arguments: None, capsys: pytest.CaptureFixture[str]) -> None:
    def sketch(model: Path, detector: Detector, limit: float) -> None:
        warnings.warn("doubtful", UserWarning, stacklevel=1)

    run(sketch)
    (line,) = capsys.readouterr().err.splitlines()
    assert "doubtful" in line


def test_an_argument_that_does_not_fit_names_step_and_place(arguments: None) -> None:
    def sketch(model: int, detector: Detector, limit: float) -> None:
        pass

    with pytest.raises(InputError) as refusal:
        run(sketch)
    assert (refusal.value.source, refusal.value.field) == ("sketch", "model")


def test_bounds_of_an_argument_hold(arguments: None) -> None:
    def sketch(model: Path, detector: Detector, limit: Annotated[int, Range(4, 9)]) -> None:
        pass

    with pytest.raises(InputError) as refusal:
        run(sketch)
    assert refusal.value.field == "limit"


def test_after_a_step_nothing_is_collected_at_exit(arguments: None) -> None:
    def sketch(model: Path, detector: Detector, limit: float) -> None:
        pass

    run(sketch)
    frozen = gc.get_freeze_count()
    gc.unfreeze()
    assert frozen > 0


def test_a_mistake_in_a_step_is_not_hidden(arguments: None) -> None:
    def sketch(model: Path, detector: Detector, limit: float) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        run(sketch)
