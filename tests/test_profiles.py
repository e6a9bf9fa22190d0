"""The profile for a Slurm cluster: which rules it names, and what it asks the cluster for."""

import re

import yaml

from tests.workflow_cases import ROOT

SLURM, DEFAULT = (
    yaml.safe_load((ROOT / "profiles" / name / "config.yaml").read_text()) for name in ("slurm", "default")
)


def rules():
    """The text of every rule, by name; a derived rule also has that of its base."""
    text = "\n".join(path.read_text() for path in [*(ROOT / "rules").glob("*.smk"), ROOT / "Snakefile"])
    texts = dict(re.findall(r"^rule (\w+):\n(.*?)(?=^\S|\Z)", text, re.MULTILINE | re.DOTALL))
    derived = re.findall(r"^use rule (\w+) as (\w+) with:\n(.*?)(?=^\S|\Z)", text, re.MULTILINE | re.DOTALL)
    return texts | {name: texts[base] + changes for base, name, changes in derived}


def test_every_rule_on_the_device_has_a_gpu_and_no_other_rule_has():
    asked = {rule for rule, resources in SLURM["set-resources"].items() if resources.get("gpu")}
    assert asked - {"span_tree"} == {rule for rule, text in rules().items() if "opencl_device=" in text}
    assert asked <= rules().keys()


def test_no_solver_outlives_a_run_that_is_killed():
    """Snakemake's default scheduler starts a solver as a child, and may wait for it with the lock held."""
    assert DEFAULT["scheduler"] == "greedy"


def test_jobs_of_a_cluster_do_not_take_turns():
    assert "opencl_device=1" in DEFAULT["resources"]
    assert "resources" not in SLURM
