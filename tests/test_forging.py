"""Forgery: what claims on a stranger's clean model reach, and what refuses them."""

import numpy as np
import pytest

from gspure.cli import main
from gspure.evaluation.forging import Forger, forgeries
from gspure.files import read_json, write_json
from gspure.opencl.device import choose_device
from gspure.schemes.scheme import hide

PICTURES = 40


@pytest.fixture(scope="module")
def claims(trained):
    """Return a function from a scheme's name to its forgeries by name, on another training of the scene."""

    def reached(name):
        own = trained(name)
        pictures = np.random.default_rng(0).integers(256, size=(2 * PICTURES, 2, 18, 24, 3), dtype=np.uint8)
        judged, chosen = np.split(pictures, 2)
        forger = Forger(own.scheme, own.public, own.key, own.pair, judged, chosen, choose_device())
        stranger, _ = hide(own.scheme, own.pair, seed=1, **own.settings, message_weight=0)
        return {claim.forgery: claim for claim in forgeries(forger, stranger, 60, 20_000)}

    return reached


def test_keys_of_patterns_that_fit_a_model_break_the_commitment_and_a_copied_mark_shows(claims):
    reached = claims("keyed_pattern")
    assert reached["own model"].p == reached["searched key"].p == 1e-4
    assert reached["fitted key"].read == 100
    assert reached["fitted key"].p < 0.01
    assert [claim.is_late for claim in reached.values()] == [False, True, False, True]
    assert reached["copied mark"].fidelity > 30


def test_hidden_colours_that_learned_a_message_show_it_in_twins_as_well_and_prove_nothing(claims):
    reached = claims("splats_in_splats")
    least = 1 / (PICTURES + 1)
    assert reached["own model"].p == least
    assert reached["fitted key"].read > 20
    assert min(claim.p for name, claim in reached.items() if name != "own model") > least


def test_the_command_says_what_a_commitment_refuses_and_needs_a_message_with_candidates(pair_folder, tmp_path, capsys):
    words = ["embed", "keyed_pattern", str(pair_folder), "--set=iterations=30", "--set=max_gaussians=400"]
    assert main([*words, "--out", str(tmp_path / "own")]) == 0
    words = ["forge", str(tmp_path / "own" / "key" / "clean.ply"), "--marked", str(tmp_path / "own")]
    assert main([*words, "--out", str(tmp_path / "claims.csv")]) == 0
    assert "rule out: fitted key, searched key\n" in capsys.readouterr().out
    assert len((tmp_path / "claims.csv").read_text().splitlines()) == 5
    record = read_json(tmp_path / "own" / "key" / "provenance.json")
    record["inputs"]["pair"]["path"] = str(tmp_path)
    write_json(tmp_path / "own" / "key" / "provenance.json", record)
    assert main([*words, "--scheme", "splats_in_splats"]) == 2
    assert "ray-traced" in capsys.readouterr().err
