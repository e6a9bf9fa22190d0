"""Steps of the workflow: how one starts and ends, the decision from files, and what the owner's key reveals."""

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest

from gspure.arrays import Float32, load_array, save_array
from gspure.errors import InputError
from gspure.evaluation.deciding import DecisionFiles, decide, diagnosis_record
from gspure.evaluation.plan import Detector
from gspure.evaluation.revealing import reveal
from gspure.method.clusters import read_labels, select
from gspure.method.diagnosis import diagnose
from gspure.method.pruning import prune_mask
from gspure.method.settings import ClusterSettings, MethodSettings, PruningFactors
from gspure.method.tree import spanning_tree
from gspure.metrics.targets import ADAPTIVE, MESSAGE
from gspure.model import Gaussians, write_model
from gspure.opencl.device import choose_device
from gspure.settings import Range
from gspure.workflow.step import run
from tests import evaluation_cases as cases
from tests.models import blobs


@pytest.fixture(autouse=True)
def arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = {"detector": {"command": "read"}, "limit": 3}
    files = {"model": "a/b.ply"}
    monkeypatch.setattr("sys.argv", ["rules/steps/sketch.py", json.dumps(settings), json.dumps(files)])


def raising(error: Exception) -> Callable[..., None]:
    """A step that takes the arguments and fails."""

    def sketch(model: Path, detector: Detector, limit: float) -> None:
        raise error

    return sketch


def test_a_step_gets_the_entries_of_all_objects_as_values_of_its_types() -> None:
    calls: list[Any] = []

    def sketch(model: Path, detector: Detector, limit: float, missing: Path | None = None) -> None:
        calls.append((model, detector, limit, missing))

    run(sketch)
    assert repr(calls) == repr([(Path("a/b.ply"), Detector("read"), 3.0, None)])


REFUSALS = {
    "a.ply: x: expected a number, found none": InputError("a.ply", "x", expected="a number", found="none"),
    "out of memory: too large": MemoryError("too large"),
    "a.ply: No such file": FileNotFoundError(2, "No such file", "a.ply"),
}


@pytest.mark.parametrize("line", REFUSALS)
def test_a_refusal_is_the_last_line_and_status_2(capsys: pytest.CaptureFixture[str], line: str) -> None:
    with pytest.raises(SystemExit) as end:
        run(raising(REFUSALS[line]))
    assert end.value.code == 2
    assert capsys.readouterr().err == f"gspure sketch: {line}\n"


def test_a_mistake_in_a_step_is_not_hidden() -> None:
    with pytest.raises(ZeroDivisionError):
        run(raising(ZeroDivisionError()))


@pytest.mark.parametrize(("name", "kind"), [("model", int), ("limit", Annotated[int, Range(4, 9)])])
def test_an_argument_that_does_not_fit_names_step_and_place(name: str, kind: Any) -> None:
    sketch = raising(ZeroDivisionError())
    sketch.__annotations__[name] = kind
    with pytest.raises(InputError) as refusal:
        run(sketch)
    assert (refusal.value.source, refusal.value.field) == ("sketch", name)


ROWS = 40
SELECTING = ClusterSettings(min_cluster_size=5, selection="eom", max_cluster_share=0.9)
FACTORS = PruningFactors(tau_c=1.5, tau_n=3.0)
RNG = np.random.default_rng(0)
CENTRES = np.repeat([[0.0, 0.0], [5.0, 0.0], [0.0, 5.0]], [15, 15, 10], axis=0) + RNG.normal(0, 0.1, (ROWS, 2))
WEIGHTS = RNG.lognormal(0, 2, ROWS).astype(np.float32)
WEIGHTS[0] = 0


def decided(folder: Path, weights: Float32) -> DecisionFiles:
    """Decide from files in a folder."""
    inputs = [folder / name for name in ("model.ply", "tree.npy", "weights.npy")]
    write_model(inputs[0], blobs(ROWS, sh_degree=0))
    save_array(inputs[1], spanning_tree(CENTRES, 3))
    save_array(inputs[2], weights)
    out = DecisionFiles(folder / "out/clusters.npz", folder / "out/prune_mask.npy", folder / "out/diagnosis.json")
    decide(*inputs, SELECTING, FACTORS, out)
    return out


def test_clusters_and_mask_of_a_decision_are_those_of_the_tree_and_the_weights(tmp_path: Path) -> None:
    out = decided(tmp_path, WEIGHTS)
    labels = select(spanning_tree(CENTRES, 3), **asdict(SELECTING))
    assert labels.max() == 2
    np.testing.assert_array_equal(read_labels(out.clusters), labels)
    mask = load_array(out.prune_mask, dtype=np.bool_, shape=(ROWS,))
    np.testing.assert_array_equal(mask, prune_mask(labels, WEIGHTS, **asdict(FACTORS)))
    assert 0 < mask.sum() < ROWS
    record = json.loads(out.diagnosis.read_text())
    assert (record["quantity"], record["clusters"]) == ("weights", 3)
    assert record["pruned_share"] == pytest.approx(mask.mean())
    provenance = json.loads((out.prune_mask.parent / "provenance.json").read_text())
    assert provenance["settings"] == {**asdict(SELECTING), **asdict(FACTORS)}
    assert provenance["inputs"].keys() == {"model", "tree", "weights"}


@pytest.mark.parametrize("weights", [np.full(ROWS, -0.5, np.float32), np.ones(ROWS - 1, np.float32)])
def test_weights_of_another_model_or_below_zero_are_refused(tmp_path: Path, weights: Float32) -> None:
    with pytest.raises(InputError, match=r"weights\.npy"):
        decided(tmp_path, weights)


def with_lost_row(model: Gaussians, row: int) -> Gaussians:
    """The model with a row whose centre is no number."""
    x = model.table["x"].copy()
    x[row] = np.nan
    return model.with_columns({"x": x})


def test_the_record_of_a_decision_has_diagnosis_suspicions_and_scans() -> None:
    model = with_lost_row(blobs(ROWS, sh_degree=0), 3)
    diagnosis = diagnose(np.zeros(ROWS, np.int32), np.linspace(0, 1, ROWS, dtype=np.float32))
    record = diagnosis_record(diagnosis, model, np.arange(ROWS) < 10)
    assert record["gaussians"] == ROWS
    assert any(3 in rows for rows in record["suspicious"].values())
    assert record["scan"].keys() == {"before", "after"}
    assert diagnosis_record(diagnosis, model, np.ones(ROWS, np.bool_))["scan"].keys() == {"before"}


def test_a_key_reveals_the_rows_of_the_message_and_what_they_show(tmp_path: Path) -> None:
    lost = 5
    with cases.project(tmp_path):
        cases.LanternModel(with_lost_row(cases.public_rows(), lost)).write(cases.PUBLIC)
        revealed = reveal(cases.PUBLIC, cases.owner(), MethodSettings(), choose_device())
        gaussians, rows = revealed.message(cases.views()[1])
    of_message = [row for row in range(cases.ROWS)[cases.MESSAGE_ROWS] if row != lost]
    weighted = np.flatnonzero(revealed.hidden)
    assert len(revealed.hidden) == cases.ROWS
    assert {*weighted} <= {*of_message}
    assert weighted.max() >= cases.SHOWN[MESSAGE]  # of the last extraction, which is the most complete one
    assert rows.tolist() == of_message
    key = cases.lantern_key()
    shown, _ = key.revealed(cases.LanternModel(cases.public_rows()[rows]), ADAPTIVE)
    assert gaussians.table.tobytes() == shown.table.tobytes()
    public = cases.LanternModel(cases.public_rows())
    image = key.message(public, MESSAGE)(cases.views()[4])  # as published, in a training view
    np.testing.assert_array_equal(revealed.extracted(public), image)
