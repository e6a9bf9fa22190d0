"""The configurations for photographs: what they ask for, and how large their graphs are. Nothing is downloaded."""

import pytest
import yaml

from gspure.datasets import SCENES
from gspure.workflow.config import DEFAULT_VARIANTS
from tests.training_cases import colmap_project, ring
from tests.workflow_cases import ROOT, started

pytestmark = pytest.mark.workflow


def captures(folder, names):
    """Small captures in place of those that a configuration names."""
    for name in names:
        colmap_project(folder / name, ring(9), [[0.1 * i, 0.0, 0.0] for i in range(9)])


@pytest.fixture
def project(tmp_path):
    return started(tmp_path / "project")


def test_the_grid_of_the_paper_has_a_job_per_model_and_variant_never_one_per_view(project):
    captures(project.folder / "data", SCENES)
    config = yaml.safe_load((ROOT / "config" / "mipnerf360.yaml").read_text())
    project.configure(config)
    messages = {pair["message"] for pair in config["pairs"].values()}
    models, variants = len(config["pairs"]) * len(config["schemes"]), len(DEFAULT_VARIANTS)
    jobs = project.planned()
    once = ["embed_message", "train_clean_model", "prepare_cameras_of_pair", "accumulate_weights", "span_tree"]
    once += ["decide_pruning", "measure_surface", "draw_model", "evaluate_controls"]
    expected = {"make_pair": 9, "train_message": len(messages), "write_report": 1}
    expected |= dict.fromkeys(once, models)
    expected["measure_contributions"] = config["views"]["parts"] * models
    expected["evaluate_variant"] = variants * models
    assert jobs.items() >= expected.items()
    assert "train_model" not in jobs
    assert jobs["total"] < 35 * models


def test_two_user_captures_are_hidden_in_each_other(project):
    captures(project.folder / "photos", ["scene", "message"])
    project.configure(yaml.safe_load((ROOT / "config" / "photos.yaml").read_text()))
    jobs = project.planned()
    assert jobs.items() >= {"train_message": 2, "make_pair": 2, "embed_message": 2, "write_report": 1}.items()
