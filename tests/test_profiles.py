"""The profile for a Slurm cluster: which rules it names, and what it asks the cluster for."""

import re

import yaml

from tests.documentation import ROOT

PROFILE = yaml.safe_load((ROOT / "profiles" / "slurm" / "config.yaml").read_text())


def rules_on_the_device():
    """The rules whose jobs have as many threads as the device needs."""
    text = "\n".join(path.read_text() for path in sorted((ROOT / "rules").glob("*.smk")))
    on_device = {}
    pattern = r"^(?:use )?rule (?:(\w+) as )?(\w+)(?: with)?:\n(.*?)(?=^\S|\Z)"
    for base, name, rule in re.findall(pattern, text, re.MULTILINE | re.DOTALL):
        threads = re.search(r"threads: (.*)", rule)
        on_device[name] = "get_threads" in threads[1] if threads else on_device.get(base, False)
    return {name for name, asks in on_device.items() if asks and not name.startswith("base_")}


def test_every_rule_on_the_device_has_a_gpu_and_no_other_rule_has():
    asked = {rule for rule, resources in PROFILE["set-resources"].items() if resources.get("gpu")}
    assert asked == rules_on_the_device()
