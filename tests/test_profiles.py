"""The profiles for clusters: which rules they name, and what they ask a cluster for."""

import os
import re
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[1]
CLUSTERS = ("slurm", "kubernetes")
KUBERNETES = ROOT / "profiles" / "kubernetes"
PLACES = {"GSPURE_IMAGE": "gspure:1", "GSPURE_CLAIM": "results", "GSPURE_VOLUME": "/shared"}

KUBECTL = """\
#!/bin/sh
[ "$1" = create ] && cat > asked.yaml && echo job.batch/gspure-1
[ "$1" = get ] && printf %s "$STATUS"
[ "$1" = delete ] && echo "$@"
exit 0
"""


def profile(name):
    return yaml.safe_load((ROOT / "profiles" / name / "config.yaml").read_text())


def rules():
    """The text of every rule, by name; a derived rule also has that of its base."""
    text = "\n".join(path.read_text() for path in [*(ROOT / "rules").glob("*.smk"), ROOT / "Snakefile"])
    texts = dict(re.findall(r"^rule (\w+):\n(.*?)(?=^\S|\Z)", text, re.MULTILINE | re.DOTALL))
    derived = re.findall(r"^use rule (\w+) as (\w+) with:\n(.*?)(?=^\S|\Z)", text, re.MULTILINE | re.DOTALL)
    return texts | {name: texts[base] + changes for base, name, changes in derived}


@pytest.mark.parametrize("name", CLUSTERS)
def test_every_rule_on_the_device_has_a_gpu_and_no_other_rule_has(name):
    asked = {rule for rule, resources in profile(name)["set-resources"].items() if resources.get("gpu")}
    on_device = {rule for rule, text in rules().items() if "opencl_device=" in text}
    assert asked == on_device | {"make_pair"}  # which renders the message of photographs


@pytest.mark.parametrize("name", CLUSTERS)
def test_a_profile_names_existing_rules(name):
    assert {*profile(name)["set-resources"], *profile(name)["groups"]} <= rules().keys()


def test_both_cluster_profiles_request_the_same_resources():
    slurm, kubernetes = map(profile, CLUSTERS)
    assert slurm["set-resources"] == kubernetes["set-resources"]
    assert slurm["groups"] == kubernetes["groups"]


def test_no_solver_outlives_a_run_that_is_killed():
    """Snakemake's default scheduler starts a solver as a child, and may wait for it with the lock held."""
    assert profile("default")["scheduler"] == "greedy"


@pytest.mark.parametrize("name", CLUSTERS)
def test_jobs_of_a_cluster_do_not_take_turns(name):
    assert "opencl_device=1 # jobs" in (ROOT / "profiles" / "default" / "config.yaml").read_text()
    assert not {"resources", "cores"} & profile(name).keys()


@pytest.fixture
def kubectl(tmp_path, monkeypatch):
    """A command that writes down what Kubernetes is asked for."""
    (tmp_path / "kubectl").write_text(KUBECTL)
    (tmp_path / "kubectl").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.chdir(tmp_path)
    for name, place in PLACES.items():
        monkeypatch.setenv(name, place)
    return tmp_path


def called(script, *arguments):
    command = [KUBERNETES / script, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.parametrize(("gpus", "limits"), [("0", {}), ("1", {"nvidia.com/gpu": 1})])
def test_a_pod_has_what_the_job_needs_and_the_shared_volume(kubectl, gpus, limits):
    assert called("submit.sh", "16", "32000", "240", gpus, "/shared/job.sh") == "job.batch/gspure-1"
    job = yaml.safe_load((kubectl / "asked.yaml").read_text())["spec"]
    assert (job["activeDeadlineSeconds"], job["backoffLimit"]) == (240 * 60, 0)
    (container,) = job["template"]["spec"]["containers"]
    assert container["resources"] == {"requests": {"cpu": 16, "memory": "32000M"}, "limits": limits}
    assert (container["image"], container["workingDir"]) == ("gspure:1", str(kubectl))
    assert container["command"] == ["sh", "/shared/job.sh"]
    (mounted,), (volume,) = container["volumeMounts"], job["template"]["spec"]["volumes"]
    assert mounted == {"name": volume["name"], "mountPath": "/shared"}
    assert volume["persistentVolumeClaim"] == {"claimName": "results"}


def test_nothing_is_submitted_without_a_volume(kubectl, monkeypatch):
    monkeypatch.delenv("GSPURE_CLAIM")
    with pytest.raises(subprocess.CalledProcessError, match="returned non-zero exit status"):
        called("submit.sh", "1", "8000", "60", "0", "job.sh")
    assert not (kubectl / "asked.yaml").exists()


@pytest.mark.parametrize(("counts", "told"), [("/", "running"), ("1/", "success"), ("/1", "failed")])
def test_the_status_of_a_pod_is_reported_to_snakemake(kubectl, monkeypatch, counts, told):
    monkeypatch.setenv("STATUS", counts)
    assert called("status.sh", "job.batch/gspure-1") == told


def test_jobs_are_cancelled_together(kubectl):
    assert called("cancel.sh", "job.batch/gspure-1", "job.batch/gspure-2").endswith("gspure-1 job.batch/gspure-2")
