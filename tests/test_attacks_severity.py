"""The grid of strengths: each entry is a variant that runs."""

import numpy as np
import pytest
import yaml

from gspure.attacks import find_attack
from gspure.workflow.configuration import resolved, validated
from tests.attack_cases import evidence
from tests.documentation import ROOT
from tests.models import blobs

GRID = yaml.safe_load((ROOT / "config" / "severity.yaml").read_text())["variants"]
COUNT = 200


def settled() -> dict:
    config = {"pairs": {"room": {}}, "schemes": {"planted": {}}, "variants": GRID}
    return resolved(validated(config, ROOT / "schemas" / "config.schema.yaml", "severity.yaml"), "severity.yaml")


def test_every_entry_is_a_variant_of_a_known_attack_with_settings_of_its_own() -> None:
    variants = settled()["variants"]
    assert GRID.keys() == {name.partition("@")[0] for name in variants}
    settings = [tuple(sorted(variant.items())) for variant in variants.values()]
    assert len(set(settings)) == len(settings)


@pytest.mark.parametrize("name", settled()["variants"])
def test_every_entry_runs(name: str) -> None:
    settings = dict(settled()["variants"][name])
    settings.pop("damage", None)
    attacked = find_attack(settings.pop("attack")).apply(blobs(COUNT), evidence(COUNT), **settings)
    assert np.isfinite(attacked.model.columns(*attacked.model.table.dtype.names)).all()


@pytest.mark.parametrize(
    ("attack", "setting", "published"),
    [
        ("random_pruning", "fraction", {0.05, 0.1, 0.15, 0.25, 0.3, 0.5, 0.7}),
        ("lowest_opacity", "fraction", {0.1, 0.25, 0.3, 0.5}),
        ("inject", "fraction", {0.05, 0.1, 0.3}),
        ("gaussian_noise", "sigma", {0.0005, 0.001, 0.005, 0.01, 0.02}),
        ("opacity_noise", "sigma", {0.05, 0.1, 0.2}),
        ("position_noise", "sigma", {0.001, 0.005, 0.01}),
        ("quantize", "bits", {16, 8, 6, 4}),
        ("sh_truncation", "degree", {2, 1, 0}),
    ],
)
def test_the_published_strengths_are_there(attack: str, setting: str, published: set) -> None:
    found = {
        variant[setting]
        for variant in settled()["variants"].values()
        if variant["attack"] == attack and setting in variant
    }
    assert published <= found
