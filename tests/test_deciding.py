"""The decision of GSPure from the files of earlier steps: clusters, prune mask, and their diagnosis."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from gspure.arrays import Float32, load_array, save_array
from gspure.errors import InputError
from gspure.evaluation.deciding import DecisionFiles, decide, diagnosis_record
from gspure.method.clusters import read_labels, select
from gspure.method.diagnosis import diagnose
from gspure.method.pruning import prune_mask
from gspure.method.settings import ClusterSettings, PruningFactors
from gspure.method.tree import Tree, spanning_tree
from gspure.model import Gaussians, write_model
from tests.models import blobs

ROWS = 40
SELECTING = ClusterSettings(min_cluster_size=5, selection="eom", max_cluster_share=0.9)
FACTORS = PruningFactors(tau_c=1.5, tau_n=3.0)


class Steps(NamedTuple):
    """What a decision reads, and the files that hold it."""

    tree: Tree
    weights: Float32
    tree_file: Path
    weights_file: Path
    model_file: Path


@pytest.fixture
def steps(tmp_path: Path) -> Steps:
    rng = np.random.default_rng(0)
    centres = np.repeat([[0.0, 0.0], [5.0, 0.0], [0.0, 5.0]], [15, 15, 10], axis=0)
    tree = spanning_tree(centres + rng.normal(0, 0.1, (ROWS, 2)), 3)
    weights = rng.lognormal(0, 2, ROWS).astype(np.float32)
    steps = Steps(tree, weights, tmp_path / "tree.npy", tmp_path / "weights.npy", tmp_path / "model.ply")
    save_array(steps.tree_file, tree)
    save_array(steps.weights_file, weights)
    write_model(steps.model_file, blobs(ROWS, sh_degree=0))
    return steps


def decided(steps: Steps, folder: Path) -> DecisionFiles:
    out = DecisionFiles(folder / "clusters.npz", folder / "prune_mask.npy", folder / "diagnosis.json")
    decide(steps.model_file, steps.tree_file, steps.weights_file, SELECTING, FACTORS, out)
    return out


def test_clusters_and_mask_are_those_of_the_tree_and_the_weights(steps: Steps, tmp_path: Path) -> None:
    out = decided(steps, tmp_path / "out")
    labels = select(steps.tree, **asdict(SELECTING))
    assert labels.max() == 2
    np.testing.assert_array_equal(read_labels(out.clusters), labels)
    mask = load_array(out.prune_mask, dtype=np.bool_, shape=(ROWS,))
    np.testing.assert_array_equal(mask, prune_mask(labels, steps.weights, **asdict(FACTORS)))
    assert 0 < mask.sum() < ROWS
    record = json.loads(out.diagnosis.read_text())
    assert (record["quantity"], record["clusters"]) == ("weights", 3)
    assert record["pruned_share"] == pytest.approx(mask.mean())


def test_the_provenance_of_a_decision_has_its_settings_and_files(steps: Steps, tmp_path: Path) -> None:
    out = decided(steps, tmp_path / "out")
    record = json.loads((out.prune_mask.parent / "provenance.json").read_text())
    assert record["settings"] == {**asdict(SELECTING), **asdict(FACTORS)}
    assert {name: file["path"] for name, file in record["inputs"].items()} == {
        "model": str(steps.model_file),
        "tree": str(steps.tree_file),
        "weights": str(steps.weights_file),
    }


@pytest.mark.parametrize("weights", [np.full(ROWS, -0.5, np.float32), np.ones(ROWS - 1, np.float32)])
def test_weights_of_another_model_or_below_zero_are_refused(steps: Steps, tmp_path: Path, weights: Float32) -> None:
    save_array(steps.weights_file, weights)
    with pytest.raises(InputError, match=steps.weights_file.name):
        decided(steps, tmp_path / "out")


def test_a_weight_of_zero_is_admitted(steps: Steps, tmp_path: Path) -> None:
    weights = steps.weights.copy()
    weights[0] = 0.0
    save_array(steps.weights_file, weights)
    assert decided(steps, tmp_path / "out").prune_mask.is_file()


def with_lost_row(model: Gaussians, row: int) -> Gaussians:
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
