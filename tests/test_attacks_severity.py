"""The grid of strengths: each entry runs, and the published strengths are among them."""

import numpy as np
import pytest
import yaml

from gspure.attacks import find_attack
from tests.attack_cases import measurements
from tests.documentation import ROOT
from tests.models import blobs

GRID = yaml.safe_load((ROOT / "config" / "severity.yaml").read_text())["variants"]
COUNT = 200


def grid(name: str) -> tuple[str, dict]:
    """Return attack and settings of an entry."""
    settings = {key: value for key, value in GRID[name].items() if key not in ("attack", "damage")}
    return GRID[name].get("attack", name), settings


@pytest.mark.parametrize("name", GRID)
def test_every_entry_runs(name: str) -> None:
    attack, settings = grid(name)
    attacked = find_attack(attack).apply(blobs(COUNT), measurements(COUNT), **settings)
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
    found = {settings[setting] for name, settings in map(grid, GRID) if name == attack and setting in settings}
    default = {find_attack(attack).settings[setting]} if any(grid(n) == (attack, {}) for n in GRID) else set()
    assert published <= found | default
