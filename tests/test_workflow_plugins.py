"""A package from outside the repository, with an attack and a scheme, in the tables and on the page."""

import csv
import json

import pytest

from tests.documentation import install_example
from tests.test_workflow import Project, checkout, planned  # noqa: F401

pytestmark = pytest.mark.workflow

CONFIG = {
    "pairs": {"raised": {"views": 9, "width": 32, "height": 24}},
    "schemes": {"faint_splats": {"iterations": 40, "max_gaussians": 400}},
    "method": {"min_samples": 3, "min_cluster_size": 5},
    "variants": {"unattacked": {}, "gspure": {}, "faint_pruning": {}},
    "threads": 1,
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory, checkout):  # noqa: F811
    package = tmp_path_factory.mktemp("package")
    install_example(package)
    project = Project(tmp_path_factory.mktemp("project"), checkout, (package,))
    project.configure(CONFIG)
    project.run()
    return project


def test_an_attack_and_a_scheme_of_a_package_are_in_the_tables_and_on_the_page(finished):
    tables = finished.folder / "results" / "tables"
    with (tables / "results.csv").open(newline="") as stream:
        table = [row for row in csv.DictReader(stream) if row["scheme"] == "faint_splats"]
    rows = {(row["variant"], row["target"]): row for row in table}
    attacked = rows["faint_pruning", "scene"]
    assert float(attacked["pruned_share"]) == pytest.approx(0.25, abs=0.01)
    assert attacked["psnr"] != rows["unattacked", "scene"]["psnr"]
    assert rows["faint_pruning", "message"]["reached"] == "true"
    note = json.loads((finished.folder / "results/faint_splats/raised/figures/attacks.png.json").read_text())
    assert "faint_pruning message" in note["inputs"]
    for text in ((tables / "results.md").read_text(), (finished.folder / "results" / "report.html").read_text()):
        assert "faint splats" in text.replace("_", " ")
        assert "faint pruning" in text.replace("_", " ")


def test_an_edit_of_a_package_reruns_its_jobs(finished):
    assert "Nothing to be done" in finished.run("--dry-run")
    module = finished.packages[0] / "faint.py"
    module.write_text(module.read_text() + "# edited\n")
    jobs = planned(finished.run("--dry-run"))
    assert jobs["embed_message"] == 1
    assert jobs["attack_model"] >= 1
    assert "make_pair" not in jobs
