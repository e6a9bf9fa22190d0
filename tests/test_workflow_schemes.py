"""The workflow with a scheme and pairs: what it makes, and what a change runs again."""

import csv
from pathlib import Path
from statistics import mean

import pytest

from gspure.cli import main
from gspure.evaluation.controls import CONTROLS
from tests.recomputation import CHECKS, Results
from tests.test_workflow import Project, checkout, planned, rules_run  # noqa: F401

pytestmark = pytest.mark.workflow

TABLE = "results/tables/results.csv"
SMALL = {"views": 9, "width": 32, "height": 24}
CONFIG = {
    "pairs": {"raised": SMALL, "front": {**SMALL, "scene": "vault", "message": "room", "placement": "front"}},
    "schemes": {"splats_in_splats": {"iterations": 60, "max_gaussians": 600}},
    "method": {"min_samples": 3, "min_cluster_size": 5},
    "variants": {
        "unattacked": {},
        "gspure": {},
        "rigid_transform": {},
        "crop_all": {"attack": "crop", "fraction": 1e-9},
    },
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory, checkout):  # noqa: F811
    project = Project(tmp_path_factory.mktemp("schemes"), checkout)
    project.configure(CONFIG)
    project.run(TABLE, status=1)  # crop_all fails
    return project


@pytest.fixture(scope="module")
def rows(finished):
    with (finished.folder / TABLE).open(newline="") as stream:
        return list(csv.DictReader(stream))


def numbers(rows, variant, scene="raised", seed="0"):
    cell = (scene, seed, variant)
    return {row["target"]: row for row in rows if (row["scene"], row["seed"], row["variant"]) == cell}


def scene_psnr(metrics):
    with metrics.open(newline="") as stream:
        return mean(float(row["psnr"]) for row in csv.DictReader(stream) if row["target"] == "scene")


def test_every_pair_has_its_model_key_and_clean_model(finished):
    for pair in CONFIG["pairs"]:
        folder = finished.folder / "results" / "splats_in_splats" / pair
        for file in ("public/point_cloud.ply", "key/splats_in_splats.npz", "clean/public/point_cloud.ply"):
            assert (folder / file).is_file()


def test_variants_and_controls_are_in_the_table_with_every_extraction(rows):
    assert {row["variant"] for row in rows} == {*CONFIG["variants"], *CONTROLS}
    assert set(numbers(rows, "gspure")) == {"scene", "message", "message_adaptive", "message_oracle"}
    assert set(numbers(rows, "wrong_key")) == {"message", "message_adaptive", "message_oracle"}
    assert {row["reference"] for row in rows if row["target"]} == {"truth"}


def test_a_message_stands_out_from_its_controls(rows):
    shown = {name: float(numbers(rows, name)["message_oracle"]["psnr"]) for name in ("unattacked", *CONTROLS)}
    assert shown["unattacked"] > max(shown[name] for name in CONTROLS) + 2


def test_a_moved_model_is_rendered_from_moved_views(rows):
    before, after = (float(numbers(rows, name)["scene"]["psnr"]) for name in ("unattacked", "rigid_transform"))
    assert after == pytest.approx(before, abs=0.5)


def test_a_refused_attack_is_reported_and_the_run_continues(rows):
    (row,) = numbers(rows, "crop_all").values()
    assert "attack crop: " in row["failure"]
    assert not row["psnr"]


def test_extractions_are_compared_with_flips_the_scene_another_message_and_random_scenes(rows):
    for variant in ("unattacked", "gspure", "clean"):
        row = numbers(rows, variant)["message"]
        assert (row["retrieval_views"], row["retrieval_candidates"]) == ("2", str(1 + 3 + 1 + 1 + 10))
    assert not numbers(rows, "black")["message"]["retrieval_views"]


def test_the_verdict_states_whether_the_carrier_was_reached(rows):
    assert {t: row["reached"] for t, row in numbers(rows, "unattacked").items() if t != "scene"} == {
        "message": "false",
        "message_adaptive": "false",
        "message_oracle": "false",
    }
    assert numbers(rows, "gspure")["message"]["reached"] == "true"


def test_every_number_of_the_tables_follows_from_images_arrays_and_records(finished, tmp_path):
    project = finished.copy(tmp_path / "project")
    tables, costs = project.folder / "results" / "tables", project.folder / "results" / "benchmarks"
    outputs = [("--out", "contest.csv"), ("--survival", "survival.csv"), ("--matched", "matched.csv")]
    words = [word for option, name in (*outputs, ("--markdown", "contest.md")) for word in (option, str(tables / name))]
    words += ["--benchmarks", str(costs), "--costs", str(costs / "attacks.csv")]
    main(["contest", "--table", str(tables / "results.csv"), *words])
    results = Results(project.folder / "results")
    counts = {check.__name__: check(results) for check in CHECKS}
    assert [name for name, count in counts.items() if not count] == ["check_searched"]  # no strength was searched


def test_the_message_is_weighed_on_the_rows_that_the_pruning_factor_selects(finished, tmp_path):
    project = finished.copy(tmp_path / "project")
    project.configure({**CONFIG, "method": {"tau_n": 3}})
    printed = project.run("results/splats_in_splats/raised/hidden.json", "--dry-run", "--printshellcmds", "--force")
    assert "--tau-n 3" in next(line for line in printed.splitlines() if "gspure hidden" in line)


def test_a_pair_is_repeated_with_other_seeds_of_training_and_attacks(finished, tmp_path):
    project = finished.copy(tmp_path / "project")
    project.configure({**CONFIG, "repetitions": 2})
    printed = project.run(TABLE, "--dry-run", "--printshellcmds")
    jobs = planned(printed)
    assert (jobs["embed_message"], jobs["train_clean_model"], jobs.get("make_pair", 0)) == (2, 2, 0)
    repeated = [line for line in printed.splitlines() if "raised@1" in line and "python -m gspure" in line]
    trained = next(line for line in repeated if "embed splats_in_splats results/pairs/raised --seed 1" in line)
    assert "--out results/splats_in_splats/raised@1" in trained
    assert any("attack rigid_transform" in line and "--seed 1" in line for line in repeated)

    metrics = [f"results/splats_in_splats/{asset}/unattacked/metrics.csv" for asset in ("raised", "raised@1")]
    assert rules_run(project.run(metrics[1]))["embed_message"] == 1
    first, second = (scene_psnr(project.folder / path) for path in metrics)
    assert first != second
    assert first == pytest.approx(second, abs=3)
    assert not (project.folder / "results" / "pairs" / "raised@1").exists()


def test_nothing_runs_twice_and_a_setting_of_a_pair_concerns_that_pair_alone(finished, tmp_path):
    project = finished.copy(tmp_path / "project")
    again = planned(project.run(TABLE, "--dry-run"))
    assert again["attack_model"] == len(CONFIG["pairs"])  # those that failed are tried again
    assert not again.keys() & {"make_pair", "embed_message", "train_clean_model", "measure_contributions", "span_tree"}
    edited = {**CONFIG, "pairs": {**CONFIG["pairs"], "front": {**CONFIG["pairs"]["front"], "seed": 1}}}
    project.configure(edited)
    ran = rules_run(project.run("results/splats_in_splats/front/public/point_cloud.ply"))
    assert ran == {"make_pair": 1, "embed_message": 1}
    assert "Nothing to be done" in project.run("results/splats_in_splats/raised/public/point_cloud.ply")


def test_a_message_of_photographs_is_trained_and_moved(checkout, tmp_path):  # noqa: F811
    import numpy as np

    from tests.training_cases import colmap_project, ring

    points = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3))
    for name in ("scene", "hidden"):
        colmap_project(tmp_path / name, ring(), points)
    project = Project(tmp_path, checkout)
    pair = {"scene": "scene", "message": "hidden", "resolution": "native", "iterations": 20}
    project.configure({"pairs": {"photos": pair}, "schemes": CONFIG["schemes"]})
    ran = rules_run(project.run("results/pairs/photos/cameras.json"))
    assert ran == {"train_message": 1, "make_pair": 1}
    assert len(list(Path(tmp_path / "results/pairs/photos/message").glob("*.png"))) == len(ring())
