"""Configurations as the workflow resolves them, and a tiny project in which all of it has been run once."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from gspure.cameras import write_cameras
from gspure.evaluation.plan import Plan
from gspure.model import write_model
from gspure.workflow import planning
from gspure.workflow.config import Config
from gspure.workflow.config_reading import config_of
from tests.models import blobs, tilted_camera

ROOT = Path(__file__).parents[1]
WORKFLOW = ("gspure", "gspure_torch", "kernels_cl", "rules", "config", "profiles", "setup", "Snakefile")
CONFIG: dict[str, Any] = {
    "assets": {"bot": {"model": "bot.ply", "cameras": "views.json"}},
    "pairs": {"raised": {"views": 9, "width": 32, "height": 24}},
    "schemes": {"planted": {"gaussians": 600}},
    "method": {"min_samples": 3, "min_cluster_size": 5},
    "detectors": {"mark": {"command": f"{sys.executable} mark.py"}},
    "variants": {
        "unattacked": {},
        "gspure": {},
        "jpeg": {"quality": 10},
        "crop_all": {"attack": "crop", "fraction": 1e-9},  # cannot apply: no row would remain
        "broken": {"attack": "feature_scaling", "attributes": "nonsense"},  # its job fails
    },
    "proof": {"candidates": 19, "twins": 2},
    "threads": 1,
}
MARK = """
import json, pathlib, sys
print(json.dumps({image.stem: 0.5 for image in pathlib.Path(sys.argv[1]).glob("*.png")}))
"""


SOURCE = "mine.yaml"


def configuration(content: Mapping[str, object]) -> Config:
    """A configuration with all defaults."""
    return config_of(content, SOURCE)


def plan_of(content: Mapping[str, object]) -> Plan:
    """The plan of a configuration."""
    return planning.plan_of(configuration(content), SOURCE)


@dataclass(frozen=True)
class Project:
    """A folder with a copy of the workflow, in which it is run."""

    folder: Path

    def run(self, *arguments: str, status: int = 0) -> str:
        """Run Snakemake, and return what it printed."""
        command = [sys.executable, "-m", "snakemake", *arguments, "--cores", "2"]
        done = subprocess.run(command, cwd=self.folder, env=self.environment(), **PRINTED, check=False)
        assert done.returncode == status, done.stdout
        return str(done.stdout)

    def environment(self) -> dict[str, str]:
        return {**os.environ, "PYTHONPATH": os.pathsep.join([str(self.folder), os.environ.get("PYTHONPATH", "")])}

    def planned(self, *arguments: str) -> Counter[str]:
        """The jobs that would run, by rule."""
        jobs = re.findall(r"^(\w+) +(\d+)$", self.run("--dry-run", *arguments), re.MULTILINE)
        return Counter({rule: int(count) for rule, count in jobs})

    def configure(self, config: Mapping[str, Any]) -> None:
        (self.folder / "config" / "config.yaml").write_text(yaml.safe_dump(config))

    def copy(self, folder: Path) -> "Project":
        shutil.copytree(self.folder, folder, symlinks=True)
        return Project(folder)

    def edit(self, file: str, before: str, after: str) -> None:
        path = self.folder / file
        assert before in path.read_text()
        path.write_text(path.read_text().replace(before, after, 1))


PRINTED: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}


def started(folder: Path, config: Mapping[str, Any] = CONFIG) -> Project:
    """A project in which nothing has been run."""
    for name in WORKFLOW:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, folder / name)
    shutil.copy2(ROOT / "Makefile", folder)
    write_model(folder / "bot.ply", blobs(300, sh_degree=0))
    cameras = [tilted_camera(32, 24, name=f"view_{i}", focal=24.0 + i) for i in range(9)]
    write_cameras(folder / "views.json", cameras)
    (folder / "mark.py").write_text(MARK)
    project = Project(folder)
    project.configure(config)
    return project


def make_ready(project: Project) -> None:
    """Let `make demo` take the set-up for done, and Snakemake be that of the tests."""
    place = project.folder / ".venv"
    (place / "bin").mkdir(parents=True)
    program = place / "bin" / "gspure"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m gspure "$@" --cores 2\n')
    program.chmod(0o755)
    for name in ("pyproject.toml", *(f"setup/requirements{kind}.lock" for kind in ("", "-dev"))):
        if not (project.folder / name).exists():
            (project.folder / name).touch()
    for name in ("bin/pip", ".packages", ".opencl", ".gl"):
        (place / name).touch()


def edit_cameras(project: Project, edit: Callable[[list[dict[str, Any]]], object]) -> None:
    """Let `edit` change the list of cameras in the user's file."""
    path = project.folder / "views.json"
    cameras = json.loads(path.read_text())
    edit(cameras)
    path.write_text(json.dumps(cameras))
