"""What the workflow runs again after a change, and what it does not."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import yaml

from gspure.cameras import read_cameras, split, write_cameras
from gspure.evaluation.controls import CONTROLS, OTHER_SCENE
from gspure.model import write_model
from gspure.renderer import Renderer
from tests.models import blobs, gaussians, tilted_camera
from tests.plugin_path import PLUGIN_PATH
from tests.training_cases import colmap_project, ring

pytestmark = pytest.mark.workflow

ROOT = Path(__file__).parents[1]
WORKFLOW = ("gspure", "kernels_cl", "rules", "schemas", "config", "profiles", "envs", "report", "Snakefile")
BOT = Path("results/vanilla/bot")
OMEGA = str(BOT / "weights.npy")
TABLE = "results/tables/results.csv"
CONFIG = {
    "assets": {"bot": {"model": "bot.ply", "cameras": "views.json"}},
    "method": {"min_samples": 3, "min_cluster_size": 5},
    "variants": {"unattacked": {}, "gspure": {}, "random_matched": {}},
}
SLOW_WRITES = (
    "import os, time\nreplace = os.replace\nos.replace = lambda *a, **k: (time.sleep(0.2), replace(*a, **k))[1]\n"
)


@dataclass(frozen=True)
class Project:
    """A user's folder, and the checkout of the workflow that is run in it."""

    folder: Path
    checkout: Path
    packages: tuple[Path, ...] = ()
    """Folders of further packages that are installed."""

    def command(self, *arguments):
        return [
            sys.executable,
            "-m",
            "snakemake",
            *arguments,
            "--cores",
            "2",
            "--snakefile",
            self.checkout / "Snakefile",
        ]

    def environment(self, *python_path):
        return {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(map(str, [*python_path, *self.packages, self.checkout, *PLUGIN_PATH])),
        }

    def run(self, *arguments, status=0, beside=()):
        """Run the workflow, with configurations `beside` the project's; returns what it printed."""
        done = subprocess.run(
            [*self.command(*arguments), "--configfile", "config.yaml", *beside],
            cwd=self.folder,
            env=self.environment(),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        assert done.returncode == status, done.stdout
        return done.stdout

    @contextmanager
    def started(self, target, code, ready):
        """Start a run whose programs all run `code` first, printing into run.log; yield its process when `ready`."""
        with TemporaryDirectory() as folder, (self.folder / "run.log").open("w") as printed:
            Path(folder, "sitecustomize.py").write_text(code)
            run = subprocess.Popen(
                [*self.command(target), "--configfile", "config.yaml"],
                cwd=self.folder,
                env=self.environment(folder),
                stdout=printed,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            try:
                deadline = time.monotonic() + 60
                while not ready():
                    assert time.monotonic() < deadline
                    time.sleep(0.02)
                yield run
            finally:
                with suppress(ProcessLookupError):
                    os.killpg(run.pid, signal.SIGKILL)

    def configure(self, config):
        (self.folder / "config.yaml").write_text(yaml.safe_dump(config))

    def stages(self):
        """The stored views: when each was written, by file name."""
        return {
            path.name: path.stat().st_mtime_ns for path in self.folder.glob("stages/vanilla/bot/contributions/*.npy")
        }

    def omega(self):
        return (self.folder / OMEGA).read_bytes()

    def copy(self, folder):
        shutil.copytree(self.folder, folder)
        return replace(self, folder=folder)

    def with_own_checkout(self, folder):
        """The same project, run by a checkout that may be edited."""
        shutil.copytree(self.checkout, folder)
        return replace(self, checkout=folder)


def rules_run(output):
    return Counter(re.findall(r"Finished jobid: \d+ \(Rule: (\w+)\)", output))


def computed(before, after):
    """The views that were computed between two looks at the stages; none of the others was written again."""
    assert all(after[name] == written for name, written in before.items())
    return sorted(name.split(".")[0] for name in after.keys() - before.keys())


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    folder = tmp_path_factory.mktemp("checkout")
    for name in WORKFLOW:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, folder / name)
    return folder


@pytest.fixture(scope="module")
def started(tmp_path_factory, checkout):
    """A project in which nothing has been run."""
    folder = tmp_path_factory.mktemp("started")
    write_model(folder / "bot.ply", blobs(300, sh_degree=0))
    cameras = [tilted_camera(32, 24, name=f"view_{i}", focal=24.0 + i) for i in range(9)]
    write_cameras(folder / "views.json", cameras)
    project = Project(folder, checkout)
    project.configure(CONFIG)
    return project


@pytest.fixture(scope="module")
def finished(tmp_path_factory, started):
    """A project in which every variant has been evaluated."""
    project = started.copy(tmp_path_factory.mktemp("finished") / "project")
    project.run(TABLE)
    return project


@pytest.fixture
def project(tmp_path, finished):
    return finished.copy(tmp_path / "project")


def edit_cameras(project, edit):
    """Let `edit` change the list of cameras in the user's file."""
    path = project.folder / "views.json"
    cameras = json.loads(path.read_text())
    edit(cameras)
    path.write_text(json.dumps(cameras))


def test_an_unchanged_project_has_no_jobs(project):
    assert "Nothing to be done" in project.run(TABLE)


def test_editing_a_camera_recomputes_only_its_view(project):
    before = project.stages()
    edit_cameras(project, lambda cameras: cameras[3]["position"].__setitem__(0, 0.125))
    project.run(OMEGA)
    assert computed(before, project.stages()) == ["view_3"]


def test_adding_a_view_computes_only_that_view(project):
    before = project.stages()
    edit_cameras(project, lambda cameras: cameras.append({**cameras[1], "id": 9, "img_name": "view_9", "fx": 21.0}))
    project.run(OMEGA)
    assert computed(before, project.stages()) == ["view_9"]


def test_editing_a_kernel_recomputes_every_view(tmp_path, project):
    project = project.with_own_checkout(tmp_path / "checkout")
    assert "Nothing to be done" in project.run(TABLE)
    before = project.stages()
    with next((project.checkout / "kernels_cl").glob("contributions*.cl")).open("a") as kernel:
        kernel.write("// edited\n")
    project.run(OMEGA)
    assert len(computed(before, project.stages())) == len(before) == 7


AFTER_PRUNING = {
    "decide_pruning": 1,
    "attack_model": 2,
    "render_scene": 2,
    "compare_renders": 2,
    "tabulate_metrics": 1,
}
"""Of the three variants, the unattacked one does not depend on the pruning."""


def test_changing_tau_reruns_only_pruning_and_later_rules(project):
    project.configure({**CONFIG, "method": {**CONFIG["method"], "tau_n": 1.0}})
    before = (project.folder / BOT / "prune_mask.npy").read_bytes()
    assert rules_run(project.run(TABLE)) == AFTER_PRUNING
    assert (project.folder / BOT / "prune_mask.npy").read_bytes() != before


def test_editing_the_code_of_pruning_reruns_only_pruning_and_later_rules(tmp_path, project):
    project = project.with_own_checkout(tmp_path / "checkout")
    with (project.checkout / "gspure" / "cli" / "prune.py").open("a") as module:
        module.write("# edited\n")
    assert rules_run(project.run(TABLE)) == AFTER_PRUNING


def test_adding_a_variant_runs_only_its_jobs(project):
    project.configure(
        {**CONFIG, "variants": {**CONFIG["variants"], "half": {"attack": "random_pruning", "fraction": 0.5}}}
    )
    expected = {"attack_model": 1, "render_scene": 1, "compare_renders": 1, "tabulate_metrics": 1}
    assert rules_run(project.run(TABLE)) == expected
    assert np.load(project.folder / BOT / "half" / "prune_mask.npy").mean() == 0.5


def test_a_model_or_cameras_replaced_by_older_files_are_read_again(project):
    for name, rules in (("views.json", {"prepare_cameras"}), ("bot.ply", {"measure_contributions", "attack_model"})):
        (other := project.folder / name).rename(project.folder / "original")
        if name == "bot.ply":
            write_model(other, blobs(300, sh_degree=0, seed=1))
        else:
            other.write_text((project.folder / "original").read_text().replace("view_8", "view_9"))
        os.utime(other, (1, 1))
        assert rules <= planned(project.run(TABLE, "--dry-run")).keys()
        (project.folder / "original").replace(other)
        assert "Nothing to be done" in project.run(TABLE, "--dry-run")


@pytest.mark.parametrize("name", ["cfg_args", "checkpoints.pth"])
def test_an_edit_of_a_file_beside_a_model_is_one_of_the_model(project, name):
    for content in ("Namespace()", "Namespace(white_background=True)"):
        (project.folder / name).write_text(content)
        assert {"measure_contributions", "attack_model"} <= planned(project.run(TABLE, "--dry-run")).keys()
    (project.folder / name).unlink()
    assert "Nothing to be done" in project.run(TABLE, "--dry-run")


def test_changing_colours_recomputes_no_view(project):
    before = project.stages()
    model = blobs(300, sh_degree=0)
    write_model(project.folder / "bot.ply", model.with_columns({"f_dc_0": model.table["f_dc_0"] + 1}))
    assert rules_run(project.run(str(BOT / "features.npy")))["measure_contributions"] == 1
    assert computed(before, project.stages()) == []
    project.run(TABLE)  # the same features, whose record names another model


def test_a_killed_run_continues_with_what_is_missing_and_ends_with_the_same_bytes(tmp_path, started, finished):
    project = started.copy(tmp_path / "project")

    def whole():
        return {name: written for name, written in project.stages().items() if not name.startswith(".")}

    with project.started(OMEGA, SLOW_WRITES, lambda: len(whole()) >= 2) as victim:
        stored = whole().keys()
        os.killpg(victim.pid, signal.SIGKILL)
        victim.wait()
    before = whole()
    assert stored <= before.keys()
    assert len(before) < 7

    assert "--unlock" in project.run(OMEGA, status=1)
    project.run("--unlock")
    project.run(OMEGA)
    assert len(computed(before, whole())) == 7 - len(before)
    assert project.omega() == finished.omega()


def test_the_number_of_parts_changes_no_byte_and_computes_no_view(tmp_path, started):
    project = started.copy(tmp_path / "project")
    project.run(OMEGA, "--set-scatter", "views=2")
    in_two, before = project.omega(), project.stages()
    assert rules_run(project.run(OMEGA, "--set-scatter", "views=4"))["measure_contributions"] == 4
    assert computed(before, project.stages()) == []
    assert project.omega() == in_two


def test_a_stage_deleted_by_hand_is_named_and_restored(project):
    removed = next(project.folder.glob("stages/vanilla/bot/contributions/view_5.*.npy"))
    content = removed.read_bytes()
    removed.unlink()
    assert removed.name in project.run(OMEGA, "--forcerun", "accumulate_weights", status=1)
    assert not (project.folder / OMEGA).exists()
    before = project.stages()
    project.run(OMEGA, "--forcerun", "measure_contributions")
    assert computed(before, project.stages()) == ["view_5"]
    assert removed.read_bytes() == content


def test_the_renders_are_the_views_to_evaluate_and_some_beside_the_path(finished):
    views = split(read_cameras(finished.folder / "views.json"))[1]
    rendered = finished.folder / BOT / "gspure" / "renders" / "scene"
    aside = [f"off_path_{i:03d}" for i in range(4)]
    assert sorted(path.stem for path in rendered.glob("*.png")) == [*aside, *(view.name for view in views)]


def test_a_users_model_is_compared_with_its_own_renders(finished):
    with (finished.folder / TABLE).open() as table:
        rows = {row["variant"]: row for row in csv.DictReader(table)}
    assert {row["reference"] for row in rows.values()} == {"render"}
    assert rows["unattacked"]["psnr"] == "inf"
    assert float(rows["gspure"]["psnr"]) < 100


@pytest.fixture(scope="module")
def reported(tmp_path_factory, started):
    """A planted scene with its report."""
    project = started.copy(tmp_path_factory.mktemp("reported") / "project")
    planted = {"pairs": {"room": {"views": 9, "width": 48, "height": 36}}, "schemes": {"planted": {"gaussians": 600}}}
    project.configure({**planted, **{name: CONFIG[name] for name in ("method", "variants")}})
    project.run()
    return project


def test_a_planted_scene_runs_to_the_report_and_a_second_run_has_nothing_to_do(tmp_path, reported):
    project = reported.copy(tmp_path / "project")
    results = project.folder / "results"
    with (results / "tables" / "results.csv").open() as table:
        rows = list(csv.DictReader(table))
    shown = {(row["variant"], row["target"]) for row in rows}
    assert shown >= {(variant, target) for variant in CONFIG["variants"] for target in ("scene", "message")}
    assert {row["variant"] for row in rows} == {*CONFIG["variants"], *CONTROLS} - {OTHER_SCENE}
    assert all(float(row["recall"]) >= 0 for row in rows if row["variant"] in CONFIG["variants"])
    assert {row["reference"] for row in rows} == {"truth"}
    assert {(row["protocol"], row["initialization"]) for row in rows} == {("shared", "both")}
    with (results / "benchmarks" / "attacks.csv").open() as costs:
        assert {row["attack"] for row in csv.DictReader(costs) if float(row["cpu"]) > 0} == {*CONFIG["variants"]}
    page = (results / "report.html").read_text()
    for part in (
        'id="verdict/planted-shared-both"',
        "CPU time [s]",
        'id="planted/room"',
        'class="lineup"',
        'class="viewer"',
        'href="logs"',
    ):
        assert part in page
    assert "Nothing to be done" in project.run()
    project.run("--report", "snakemake.html")
    assert (project.folder / "snakemake.html").stat().st_size > 100_000


@pytest.fixture
def desk(tmp_path, checkout):
    """A project with photographs, from which a model is to be trained."""
    views = ring(9)
    colors = [[0.9, 0.2, 0.1], [0.1, 0.8, 0.3], [0.2, 0.3, 0.9]]
    means = [[-0.25, 0, 0], [0.2, 0.2, 0], [0.1, -0.2, 0.2]]
    renderer = Renderer(gaussians(means=means, scales=0.12, opacities=0.95, colors=colors))
    points = np.random.default_rng(0).normal(scale=0.25, size=(80, 3))
    colmap_project(tmp_path / "photos", views, points, [renderer.image(view) for view in views])
    project = Project(tmp_path, checkout)
    configure_training(project, iterations=20)
    return project


def configure_training(project, **settings):
    project.configure({**CONFIG, "assets": {"desk": {"train": "photos", "training": settings}}})


def planned(output):
    """The jobs of a dry run, by rule."""
    return {rule: int(count) for rule, count in re.findall(r"^(\w+) +(\d+)$", output, re.MULTILINE)}


def test_a_model_is_trained_from_photographs_once_for_everything(desk):
    jobs = planned(desk.run("--dry-run"))
    assert jobs.items() >= {"train_model": 1, "prepare_cameras": 1, "attack_model": 3, "write_report": 1}.items()
    (missing := desk.folder / "photos" / "images" / "orbit_003.png").unlink()
    assert f"photos/images/{missing.name}" in desk.run("--dry-run", status=2).splitlines()[-1]


def test_a_trained_model_is_measured_and_trained_anew_when_a_photograph_or_setting_changes(desk):
    omega, trained = "results/vanilla/desk/weights.npy", desk.folder / "results" / "vanilla" / "desk" / "trained"
    desk.run(omega)
    assert np.load(desk.folder / omega).shape == (80,)
    assert len(read_cameras(trained / "cameras.json")) == 9
    assert (trained / "metrics.csv").is_file()
    configure_training(desk, iterations=21)
    assert planned(desk.run(omega, "--dry-run"))["train_model"] == 1
    configure_training(desk, iterations=20)
    assert "Nothing to be done" in desk.run(omega, "--dry-run")
    photographs = desk.folder / "photos" / "images"
    shutil.copy(photographs / "orbit_002.png", photographs / "orbit_003.png")
    assert planned(desk.run(omega, "--dry-run"))["train_model"] == 1


@pytest.mark.parametrize(
    "tool", [["-m", "snakemake", "--lint"], ["-m", "snakefmt", "--check", "Snakefile", "rules"]], ids=str
)
def test_the_workflow_is_clean(tool):
    check = subprocess.run([sys.executable, *tool], cwd=ROOT, capture_output=True, text=True, check=False)
    assert check.returncode == 0, check.stdout + check.stderr
