"""Detectors of the user's in the workflow: which models they read, what reruns them, and how they fail."""

from __future__ import annotations

import csv
import shutil

import pytest

from gspure.errors import InputError
from gspure.model import write_model
from gspure.workflow.models import Model
from gspure.workflow.variants import Variant
from tests.models import blobs
from tests.test_workflow import CONFIG, ROOT, TABLE, checkout, planned, started  # noqa: F401
from tests.test_workflow_models import plan_of

CONTEST = "results/tables/contest.csv"
SPREAD = {"command": "python spread_spectrum.py detect --key 7"}
BITS = {"command": "python spread_spectrum.py detect --key 7 --count 8", "message": "01101001"}
ASSETS = {
    "bot": {"model": "README.md", "cameras": "orbit", "clean": "other"},
    "other": {"model": "LICENSE", "cameras": "orbit"},
}


def test_detectors_read_variants_and_the_clean_model_of_every_model(monkeypatch):
    monkeypatch.chdir(ROOT)
    plan = plan_of(assets=ASSETS, detectors={"spread": SPREAD}, repetitions=1, decisions=None, variants=None)
    bot, other, marked = (
        Model(plan, *name) for name in (("vanilla", "bot"), ("vanilla", "other"), ("secure_gs", "front"))
    )
    assert f"{bot.folder}/clean/detections/spread.csv" in bot.detections
    assert len(bot.detections) == len(plan.config["variants"]) + 1 == len(marked.detections)
    assert other.detections == []
    assert Variant(bot, "clean").public == "LICENSE"
    assert bot.controls == ["clean"]
    assert Variant(bot, "gspure").detection_options("spread").endswith("--key 7' --timeout 600")


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"assets": {"bot": ASSETS["bot"]}}, "assets.bot.clean"),
        ({"assets": {"bot": {**ASSETS["bot"], "clean": "bot"}}}, "assets.bot.clean"),
        ({"assets": {"bot": ASSETS["bot"], "other": {**ASSETS["other"], "clean": "bot"}}}, "assets.bot.clean"),
        (
            {"assets": {"top": {**ASSETS["other"], "model": "Makefile", "clean": "bot"}, **ASSETS}},
            "assets.top.clean: expected another asset without `clean` (other)",
        ),
        ({"detectors": {"scene": SPREAD}}, "detectors.scene"),
        ({"detectors": {"message_mine": SPREAD}}, "detectors.message_mine"),
        ({"detectors": {"mine": {"command": "python 'x"}}}, "detector"),
        ({"detectors": {"mine": {"command": ""}}}, "detectors.mine.command"),
        ({"detectors": {"mine": {**SPREAD, "message": "01a"}}}, "detectors.mine.message"),
        ({"detectors": {"mine": {**SPREAD, "timeout": 0}}}, "detectors.mine.timeout"),
        ({"detectors": {"mine": {}}}, "detectors.mine.command"),
    ],
)
def test_a_faulty_detector_is_refused_before_any_job(monkeypatch, changes, place):
    monkeypatch.chdir(ROOT)
    with pytest.raises(InputError) as refusal:
        plan_of(**changes)
    assert place in str(refusal.value)


@pytest.mark.workflow
def test_readings_enter_the_tables_and_a_failed_detector_leaves_the_rest(tmp_path, started):  # noqa: F811
    project = started.copy(tmp_path / "project")
    shutil.copy(ROOT / "examples" / "spread_spectrum.py", project.folder)
    write_model(project.folder / "clean.ply", blobs(200, sh_degree=0))
    config = {
        **CONFIG,
        "assets": {
            "bot": {**CONFIG["assets"]["bot"], "clean": "clean"},
            "clean": {"model": "clean.ply", "cameras": "views.json"},
        },
        "detectors": {"spread": SPREAD, "hidden": BITS, "lost": {"command": "python no_weights.py"}},
        "variants": {"unattacked": {}, "gspure": {}},
        "views": {"off_path": 0},
    }
    project.configure(config)
    project.run(TABLE, "--keep-going", status=1)
    with (project.folder / TABLE).open() as table:
        rows = {(row["scene"], row["variant"], row["target"]): row for row in csv.DictReader(table)}
    for variant in ("unattacked", "gspure", "clean"):
        assert rows["bot", variant, "hidden"]["detection_bits"] == "8"
        assert abs(float(rows["bot", variant, "spread"]["detection_level"])) < 10
        assert "no_weights.py" in rows["bot", variant, "lost"]["failure"]
        assert rows["bot", variant, "scene"]["psnr"]
    assert not any(scene == "clean" and target != "scene" for scene, _, target in rows)

    project.configure({**config, "detectors": {"spread": SPREAD, "hidden": BITS}})
    with (project.folder / "spread_spectrum.py").open("a") as script:
        script.write("# edited\n")
    jobs = planned(project.run(TABLE, "--dry-run"))
    assert (jobs["detect_mark"], jobs["tabulate_metrics"], jobs["total"]) == (6, 1, 7)


@pytest.mark.workflow
def test_files_of_an_earlier_configuration_stop_no_later_one(tmp_path, started):  # noqa: F811
    """Neither those of a variant and a detector that were removed, nor those of a model that was replaced."""
    project = started.copy(tmp_path / "project")
    shutil.copy(ROOT / "examples" / "spread_spectrum.py", project.folder)
    variants = {"unattacked": {}, "gspure": {}, "random_pruning": {}}
    config = {**CONFIG, "variants": variants, "detectors": {"spread": SPREAD}, "views": {"off_path": 0}}
    project.configure(config)
    project.run(CONTEST)
    write_model(project.folder / "bot.ply", blobs(200, 5, sh_degree=0))
    project.configure({**config, "variants": {"unattacked": {}, "gspure": {}}, "detectors": {"renamed": SPREAD}})
    project.run(CONTEST)
    assert (project.folder / "results/vanilla/bot/random_pruning/detections/spread.csv").is_file()
    assert (project.folder / "results/benchmarks/vanilla/bot/random_pruning/attack.cost.json").is_file()
    with (project.folder / TABLE).open() as table:
        assert {row["target"] for row in csv.DictReader(table)} == {"scene", "renamed"}
