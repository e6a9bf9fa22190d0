"""`gspure scan`: statistics against their null distributions, the verdict, the command."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from gspure.cameras import write_cameras
from gspure.cli import main
from gspure.model import write_model
from gspure.scan.statistics import STATISTICS, bit_entropy, clumping, flatness, repeated
from gspure.scan.verdict import LIKELY, NOTHING, UNLIKE, calibration, flagged, judge
from gspure.schemes.splats_in_splats import bits
from tests.anchor_cases import random_anchors
from tests.models import blobs, camera, joined, with_column

ROWS = 4000


@pytest.fixture(scope="module")
def plain():
    """A model whose opacities are all drawn."""
    return blobs(ROWS).with_columns({"opacity": np.random.default_rng(0).normal(size=ROWS)})


@pytest.fixture(scope="module")
def marked(plain):
    """The same model with other colours in its low bits."""
    hidden = np.random.default_rng(1).normal(0, 0.2, plain.sh_coeffs.shape).astype(np.float32)
    return plain.with_appearance(plain.table["opacity"], bits.embed(plain.sh_coeffs, hidden))


@pytest.fixture(scope="module")
def wall(plain):
    """The same model with transparent flat rows on its left."""
    left = plain.means[:, 0] < -1
    hidden = {"opacity": np.where(left, -9.0, plain.table["opacity"])}
    return plain.with_columns(hidden | {"scale_2": np.where(left, -12.0, plain.table["scale_2"])})


def test_the_entropy_of_uniform_bits_has_the_mean_and_deviation_of_its_null_distribution():
    words = np.random.default_rng(0).integers(2**32, size=(40, ROWS), dtype=np.uint32)
    model = blobs(ROWS, sh_degree=0)
    entropies = []
    for row in words:  # the fifteen windows of one column, whose least is returned
        colours = (np.uint32(0x3E800000) | row & np.uint32(0x7FFFFF)).view(np.float32)
        constant = dict.fromkeys(("f_dc_1", "f_dc_2"), np.zeros(ROWS, np.float32))
        entropies.append(bit_entropy(model.with_columns({"f_dc_0": colours} | constant)))
    deviation = np.sqrt(2 * 255) / (2 * ROWS * np.log(2))
    assert np.mean(entropies) == pytest.approx(8 - 1.74 * deviation, abs=deviation)


def test_low_bits_with_another_colour_have_a_low_entropy_and_few_levels_have_none(plain, marked):
    assert bit_entropy(plain) > 7.9
    assert bit_entropy(marked) < 5
    untrained = np.arange(ROWS) % 3 == 0
    start = np.round(plain.table["f_dc_0"] * 40) / 40
    assert bit_entropy(plain.with_columns({"f_dc_0": np.where(untrained, start, plain.table["f_dc_0"])})) > 7.9
    assert np.isnan(bit_entropy(blobs(200)))
    names = [name for name in plain.names if name.startswith("f_")]
    assert np.isnan(bit_entropy(plain.with_columns({n: np.round(32 * plain.table[n].clip(-3, 3)) / 32 for n in names})))


def test_random_rows_neither_clump_nor_are_flatter_than_others(plain):
    rng = np.random.default_rng(2)
    order = rng.permutation(ROWS)
    masks = rng.random((200, ROWS)) < 0.1
    clumps = [clumping(mask, order) for mask in masks]
    assert abs(np.mean(clumps)) < 5 / np.sqrt(ROWS * 200)
    assert np.std(clumps) == pytest.approx(1 / np.sqrt(ROWS), rel=0.2)
    flat = [flatness(plain, mask) for mask in masks]
    m = 0.1 * ROWS
    n = 0.9 * ROWS
    deviation = np.sqrt((m + n + 1) / (12 * m * n))
    assert abs(np.mean(flat) - 0.5) < 5 * deviation / np.sqrt(200)
    assert np.std(flat) == pytest.approx(deviation, rel=0.2)


def test_rows_at_one_centre_count_unless_they_are_drawn_and_equal_in_every_column(plain):
    recoloured = plain[5:8].with_columns({"f_dc_1": np.ones(3)})
    both = joined(plain, plain[5:8], recoloured)
    assert repeated(both).sum() == 6
    assert set(both.means[repeated(both), 0]) == set(plain.means[5:8, 0])
    assert not repeated(joined(plain, plain[5:8])).any()
    transparent = plain[5:8].with_columns({"opacity": np.full(3, -9)})
    assert np.flatnonzero(repeated(joined(plain[8:], transparent, transparent))).tolist() == [*range(3992, 3998)]


def test_the_verdict_names_what_gives_a_model_away(plain, marked, wall):
    assert judge(plain).word == NOTHING
    assert judge(marked).word == LIKELY
    assert "entropy" in judge(marked).reasons[0]
    assert judge(wall).word == LIKELY
    names = [name for name in plain.names if not name.startswith("f_")]
    features = with_column(type(plain)(plain.table[names]), "semantic_0", np.ones(ROWS, np.float32))
    assert judge(features).word == LIKELY
    assert "gs_hider" in judge(features).reasons[0]


def test_a_marked_model_does_not_escape_by_its_opacities_size_or_degree(plain, marked, wall):
    drawn = wall.table["opacity"] > -9
    opaque = wall.with_columns({"opacity": wall.table["opacity"] + 9 * drawn})
    assert judge(opaque).word == LIKELY
    transparent = {"opacity": plain.table["opacity"] / 100 - 5.2}
    assert judge(plain.with_columns(transparent)).word == UNLIKE
    assert judge(marked.with_columns(transparent)).word == LIKELY
    mostly_hidden = joined(wall, *[wall[~drawn]] * 9)
    assert "never drawn" in judge(mostly_hidden).reasons[0]
    nearly_gone = judge(wall.with_columns({"opacity": np.where(drawn, transparent["opacity"], -9)}))
    assert nearly_gone.word == UNLIKE
    assert any("not counted" in reason and "clumping" in reason for reason in nearly_gone.reasons)
    assert judge(joined(*[marked] * 50)).word == LIKELY
    base_only = type(wall)(wall.table[[name for name in wall.names if not name.startswith("f_rest_")]])
    assert judge(base_only).word == LIKELY


def test_anchors_are_unlike_the_calibration():
    assert judge(random_anchors().table).word == UNLIKE  # Scaffold-GS looks the same


def test_the_thresholds_separate_the_committed_files():
    table = Path(__file__).parents[1] / "experiments" / "results" / "scan" / "models.csv"
    limits = {name: row.threshold for name, row in calibration().items()}
    suspects = {"clean": [], "splats_in_splats": []}
    with table.open(encoding="utf-8", newline="") as stream:
        for row in csv.DictReader(stream):
            if row["family"] == "clean" or (row["family"], row["attack"]) == ("splats_in_splats", "gspure"):
                values = {s.name: float(row[s.name] or "nan") for s in STATISTICS}
                suspects[row["family"]].append(bool(flagged(values, limits)))
    assert len(suspects["clean"]) == calibration()["rows"].files >= 200
    assert np.mean(suspects["clean"]) <= 0.01
    assert all(suspects["splats_in_splats"])


def test_the_command_prints_the_verdict_and_needs_no_device_for_a_file(marked, tmp_path, capsys, monkeypatch):
    write_model(tmp_path / "model.ply", marked)
    monkeypatch.setenv("GSPURE_DEVICE", "none of this name")
    assert main(["scan", str(tmp_path / "model.ply")]) == 0
    first, reason, *_ = capsys.readouterr().out.splitlines()
    assert first == f"{tmp_path / 'model.ply'}: {LIKELY}"
    assert "entropy" in reason
    assert main(["scan", str(tmp_path / "model.ply"), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["verdict"] == LIKELY
    assert facts["statistics"]["bit_entropy"]["value"] < facts["statistics"]["bit_entropy"]["threshold"]


def test_cameras_add_the_rows_that_no_view_shows_and_a_picture_of_them(plain, tmp_path, capsys):
    behind = plain.with_columns({"z": np.where(plain.means[:, 0] < -1, -5, plain.means[:, 2])})
    write_model(tmp_path / "model.ply", behind)
    write_cameras(tmp_path / "cameras.json", [camera(60, 60, name=f"view_{i}") for i in range(3)])
    arguments = ["--cameras", str(tmp_path / "cameras.json"), "--picture", str(tmp_path / "rows.png"), "--quiet"]
    assert main(["scan", str(tmp_path / "model.ply"), *arguments, "--json"]) == 0
    statistics = json.loads(capsys.readouterr().out)["statistics"]
    assert statistics["unseen"]["value"] >= np.mean(plain.means[:, 0] < -1)
    assert statistics["unseen_clump"]["value"] > 0.3
    assert (tmp_path / "rows.png").is_file()
