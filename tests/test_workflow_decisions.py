"""The workflow with further decisions: what they share, what they change, and which evidence an attack is given."""

import numpy as np
import pytest
import yaml

from gspure.artifacts import read_json
from tests.documentation import ROOT
from tests.test_workflow import BOT, CONFIG, TABLE, Project, checkout, planned, rules_run, started  # noqa: F401

pytestmark = pytest.mark.workflow

DECISIONS = {
    "harsh": {"tau_n": 1, "tau_c": 1},
    "without_weight": {"cluster_on": ["position", "opacity"]},
    "ewa": {"energy": "ewa"},
}
VARIANTS = {
    "unattacked": {},
    "gspure": {},
    "plain_weight": {},
    **{name: {"attack": "gspure", "decision": name} for name in DECISIONS},
    "plain_harsh": {"attack": "plain_weight", "decision": "harsh"},
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory, started):  # noqa: F811
    project = started.copy(tmp_path_factory.mktemp("decisions") / "project")
    project.configure({**CONFIG, "variants": VARIANTS, "decisions": DECISIONS})
    return project, rules_run(project.run(TABLE))


def removed(finished, variant):
    return np.load(finished[0].folder / BOT / variant / "prune_mask.npy")


def test_each_stage_runs_once_for_all_decisions_that_have_it_in_common(finished):
    expected = {"measure_contributions": 2, "accumulate_weights": 2, "build_features": 2, "span_tree": 3}
    expected |= {"select_clusters": 3, "decide_pruning": 4, "measure_opacities": 1, "attack_model": len(VARIANTS)}
    assert finished[1].items() >= expected.items()
    assert "Nothing to be done" in finished[0].run(TABLE)


def test_decisions_lie_beside_that_of_the_method_with_what_is_their_own(finished):
    folder = finished[0].folder / BOT / "decisions"
    arrays = {path.name: sorted(file.name for file in path.glob("*.np?")) for path in folder.iterdir()}
    last = ["clusters.npz", "prune_mask.npy", "tree.npy"]
    assert arrays == {
        "harsh": ["prune_mask.npy"],
        "without_weight": last,
        "ewa": sorted([*last, "features.npy", "weights.npy"]),
    }


def test_a_variant_is_given_the_evidence_of_its_decision(finished):
    for name in DECISIONS:
        mask = np.load(finished[0].folder / BOT / "decisions" / name / "prune_mask.npy")
        assert (removed(finished, name) == mask).all()
        assert (removed(finished, name) != removed(finished, "gspure")).any()


def test_without_the_weight_opacities_decide(finished):
    note = read_json(finished[0].folder / BOT / "decisions" / "without_weight" / "prune_mask.npy.json")
    assert note["inputs"]["weights"]["file"] == "opacities.npy"


def test_a_rule_without_clusters_takes_the_factor_for_noise_of_its_decision(finished):
    weights = np.load(finished[0].folder / BOT / "weights.npy").astype(float)
    assert (removed(finished, "plain_weight") == (weights < weights.mean() / 4)).all()
    assert (removed(finished, "plain_harsh") == (weights < weights.mean())).all()


@pytest.mark.parametrize(
    ("name", "more"),
    [
        ("sweep", {"decide_pruning": 6}),
        (
            "ablations",
            {
                "measure_contributions": 1,
                "accumulate_weights": 3,
                "build_features": 3,
                "span_tree": 5,
                "select_clusters": 9,
                "decide_pruning": 9,
            },
        ),
    ],
)
def test_a_shipped_configuration_contains_only_its_changes(started, name, more):  # noqa: F811
    before = planned(started.run("--dry-run"))
    after = planned(started.run("--dry-run", beside=[ROOT / "config" / f"{name}.yaml"]))
    stages = ("measure_contributions", "accumulate_weights", "build_features", "span_tree", "select_clusters")
    added = {rule: after[rule] - before[rule] for rule in (*stages, "decide_pruning")}
    assert {rule: count for rule, count in added.items() if count} == more
    variants = yaml.safe_load((ROOT / "config" / f"{name}.yaml").read_text())["variants"]
    assert after["attack_model"] == len(variants | CONFIG["variants"])
