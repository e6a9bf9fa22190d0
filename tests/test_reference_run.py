"""The reference run: its parts are configurations, and the small one gives its committed record again."""

from pathlib import Path

import pytest
import yaml

from experiments import reference
from gspure.evaluation.results import read_results
from gspure.opencl.device import choose_device
from gspure.workflow.config_reading import read_config

PARTS = yaml.safe_load(reference.CONFIGURATION.read_text())["parts"]
RECORDED_ON = "pthread-skylake-avx512-AMD EPYC"


@pytest.mark.parametrize("name", PARTS)
def test_a_part_of_the_reference_run_is_a_configuration(tmp_path, name):
    file = tmp_path / "part.yaml"
    file.write_text(yaml.safe_dump(PARTS[name]))
    assert read_config([file], {}, name).schemes.keys() == PARTS[name]["schemes"].keys()


@pytest.mark.workflow
def test_the_small_reference_run_reproduces_its_committed_record(tmp_path):
    reference.run("small", PARTS["small"], tmp_path, Path("-"))
    rows = reference.measured(tmp_path)
    recorded = read_results(reference.RESULTS / "small.csv")
    words = [(row.variant, row.owner, row.word) for row in rows]
    assert words == [(row.variant, row.owner, row.word) for row in recorded]
    if choose_device().name == RECORDED_ON:  # another device rounds otherwise
        assert [repr(row._replace(run="")) for row in rows] == [repr(row._replace(run="")) for row in recorded]
