"""Decisions: what they inherit, what they share, and which variants make a sweep; the shipped sets of them."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from gspure.attacks import find_attack
from gspure.attacks.attack import Attack
from gspure.evaluation.paper import read_cells
from gspure.workflow.configuration import resolved, validated
from gspure.workflow.decisions import ARTIFACTS, DEFAULT, decisions, factors_of, origin, sweeps
from gspure.workflow.variants import Variant
from tests.documentation import ROOT

SUITED = {"tau_c": 3.0, "tau_n": 2.0}
SHIPPED = {
    name: yaml.safe_load((ROOT / "config" / f"{name}.yaml").read_text())
    for name in ("ablations", "paper", "sweep", "views")
}


def settled(**config):
    schema = ROOT / "schemas" / "config.schema.yaml"
    return resolved(
        validated({"pairs": {"room": {}}, "schemes": {"planted": {}}, **config}, schema, "mine.yaml"), "mine.yaml"
    )


def made(config):
    """How many decisions make each artifact, beside the method's."""
    among = decisions(config, SUITED)
    return {artifact: len({origin(among, name, artifact) for name in among} - {DEFAULT}) for artifact in ARTIFACTS}


def test_a_decision_overrides_settings_of_the_method():
    config = settled(method={"min_samples": 7, "tau_n": 1.5}, decisions={"leaf": {"selection": "leaf", "tau_c": 9}})
    among = decisions(config, SUITED)
    assert list(among) == [DEFAULT, "leaf"]
    assert among[DEFAULT] == {"cluster_on": ["position", "opacity", "weight"], **config["method"], "tau_c": 3.0}
    assert among["leaf"] == {**among[DEFAULT], "selection": "leaf", "tau_c": 9}


def test_a_null_factor_is_that_of_the_scheme_not_of_the_method():
    config = settled(method={"tau_n": 4.0}, decisions={"own": {"tau_n": None}})
    assert decisions(config, SUITED)["own"]["tau_n"] == 2.0


@pytest.mark.parametrize(
    ("own", "first"),
    [
        ({"energy": "ewa"}, "contributions"),
        ({"energy": "center_ray"}, "contributions"),
        ({"reduction": "max"}, "weights.npy"),
        ({"views": 4}, "weights.npy"),
        ({"cluster_on": ["position", "weight"]}, "tree.npy"),
        ({"min_samples": 3}, "tree.npy"),
        ({"selection": "leaf"}, "clusters.npz"),
        ({"tau_n": 1}, "prune_mask.npy"),
        ({"tau_n": 2}, None),  # what suits the scheme anyhow
    ],
)
def test_a_decision_recomputes_from_its_first_different_stage(own, first):
    among = decisions(settled(decisions={"other": own}), SUITED)
    own_artifacts = [artifact for artifact in ARTIFACTS if origin(among, "other", artifact) == "other"]
    assert own_artifacts == (list(ARTIFACTS)[list(ARTIFACTS).index(first) :] if first else [])


@settings(deadline=None)
@given(st.lists(st.fixed_dictionaries({}, optional={"tau_n": st.integers(1, 3), "min_samples": st.integers(9, 11)})))
def test_decisions_share_an_artifact_exactly_if_their_settings_are_equal(own):
    among = decisions(settled(decisions={f"d{i}": settings for i, settings in enumerate(own)}), SUITED)
    for name in among:
        tree, mask = (origin(among, name, artifact) for artifact in ("tree.npy", "prune_mask.npy"))
        assert origin(among, mask, "prune_mask.npy") == mask
        assert among[mask] == among[name]
        assert among[tree]["min_samples"] == among[name]["min_samples"]
        assert list(among).index(tree) <= list(among).index(mask) <= list(among).index(name)


def test_the_sweep_makes_nothing_but_prune_masks():
    assert made(settled(**SHIPPED["sweep"])) == {**dict.fromkeys(ARTIFACTS, 0), "prune_mask.npy": 6}


def test_the_ablations_repeat_only_what_they_change():
    assert list(made(settled(**SHIPPED["ablations"])).values()) == [1, 3, 3, 5, 9, 9]


@pytest.mark.parametrize("name", SHIPPED)
def test_every_entry_of_a_shipped_set_is_used_and_its_own(name):
    variants = settled(**SHIPPED[name])["variants"]
    used = [variant["decision"] for variant in variants.values() if "decision" in variant]
    assert {*used} == {*SHIPPED[name]["decisions"]}
    said = [tuple(sorted(variant.items())) for variant in variants.values()]
    assert len(set(said)) == len(said)


def test_the_ablations_have_the_names_under_which_the_paper_s_cells_are_kept():
    printed = {cell.variant for cell in read_cells() if cell.table in (2, 3)}
    assert printed <= SHIPPED["ablations"]["variants"].keys()
    assert len(printed) == 6


def test_a_sweep_is_one_attack_at_several_strengths_and_nothing_else():
    variants = {
        "unattacked": {},
        "gspure": {},
        "gentle": {"attack": "gspure", "decision": "gentle"},
        "leaf": {"attack": "gspure", "decision": "leaf"},
        "gentle_leaf": {"attack": "gspure", "decision": "gentle_leaf"},
        "half": {"attack": "random_pruning", "fraction": 0.5},
        "random_pruning": {},
        "half_again": {"attack": "random_pruning", "fraction": 0.5, "seed": 1},
        "noise": {"attack": "gaussian_noise", "sigma": 0.2, "attributes": "base_colour"},
        "gaussian_noise": {},
    }
    named = {"gentle": {"tau_n": 9}, "leaf": {"selection": "leaf"}, "gentle_leaf": {"selection": "leaf", "tau_c": 9}}
    config = settled(decisions=named, variants=variants)
    among = decisions(config, SUITED)
    assert sweeps(config["variants"], among) == {
        "gspure": ["gspure", "gentle"],
        "gspure leaf": ["leaf", "gentle_leaf"],
        "random_pruning": ["half", "random_pruning"],
    }
    assert factors_of(config["variants"], among) == {"gspure": (2.0, 3.0), "gentle": (9, 3.0)}


def test_a_variant_at_several_damages_is_one_variant_each_and_one_sweep():
    variants = {
        "unattacked": {},
        "gspure": {},
        "gspure_scaled": {"damage": [0.3, 2]},
        "random": {"attack": "random_pruning", "damage": [0.3, 1, 2], "seed": 4},
        "noise": {"attack": "gaussian_noise", "damage": 1},
    }
    config = settled(variants=variants)
    assert config["variants"]["random@0.3dB"] == {"attack": "random_pruning", "damage": 0.3, "seed": 4}
    assert [name for name in config["variants"] if "@" not in name] == ["unattacked", "gspure"]
    assert "noise@1dB" in config["variants"]
    among = decisions(config, SUITED)
    assert sweeps(config["variants"], among) == {
        "gspure": ["gspure", "gspure_scaled@0.3dB", "gspure_scaled@2dB"],
        "random_pruning seed 4": ["random@0.3dB", "random@1dB", "random@2dB"],
    }
    assert [*factors_of(config["variants"], among)] == ["gspure"]


def test_a_sweep_is_not_named_after_a_variant_that_is_none_of_its_own():
    swept = {f"rp_{share}": {"attack": "random_pruning", "fraction": share / 100} for share in (10, 50)}
    for seed, name in ((1, "random_pruning sweep"), (0, "random_pruning")):
        config = settled(variants={"unattacked": {}, "gspure": {}, "random_pruning": {"seed": seed}, **swept})
        (found,) = sweeps(config["variants"], decisions(config, SUITED)).items()
        assert found == (name, [*(["random_pruning"] if not seed else []), "rp_10", "rp_50"])


def test_only_built_in_attacks_get_the_factors_of_a_decision():
    def temper(model, rng, *, tau: float = 0.5): ...

    found = {}
    for attack in (find_attack("plain_weight"), Attack("temper", temper)):
        decision = SimpleNamespace(settings={"tau_c": 3.0, "tau_n": 2.0})
        variant = SimpleNamespace(decision=decision, attack=attack, settings={"seed": 0})
        found[attack.name] = Variant.attack_settings.fget(variant)
    assert found == {"plain_weight": {"tau": 2.0}, "temper": {}}


def test_weights_by_another_energy_are_another_sweep():
    variants = {
        "unattacked": {},
        "gspure": {},
        "plain_weight": {},
        "ewa": {"attack": "plain_weight", "decision": "ewa"},
    }
    config = settled(decisions={"ewa": {"energy": "ewa"}}, variants=variants)
    assert sweeps(config["variants"], decisions(config, SUITED)) == {}
