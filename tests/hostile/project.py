"""Two small projects, in which every rule of the workflow and every scheme have run, and their jobs one by one."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import yaml

from gspure.artifacts import digest
from gspure.method.contributions import read_index
from gspure.schemes.registry import find_scheme
from tests.training_cases import colmap_project, ring

ROOT = Path(__file__).parents[2]
KEPT = ("results", "stages")
VARYING = {"jobs", "logs", "benchmarks", "contest.md", "contest.md.json", "report.html", "report.html.json"}
VARYING |= {"cfg_args", "cfg_args.json"}
"""What differs between runs or folders: what jobs print and cost, and a file with absolute paths."""

TARGETS = {"all", "purified"}
"""Rules that only ask for files."""

CONFIG = {
    "assets": {"desk": {"train": "photos", "training": {"iterations": 60}}},
    "pairs": {
        "hung": {"scene": "photos", "message": "hidden", "resolution": "native", "iterations": 40},
        "traced": {"protocol": "own", "views": 4, "width": 32, "height": 24},
    },
    "schemes": {"splats_in_splats": {"iterations": 60, "max_gaussians": 400}},
    "views": {"parts": 2},
    "method": {"min_samples": 3, "min_cluster_size": 5},
    "decisions": {"bolder": {"tau_n": 2.0}},
    "detectors": {"spread": {"command": "python spread_spectrum.py detect --key 7"}},
    "variants": {
        "unattacked": {},
        "gspure": {},
        "bolder": {"attack": "gspure", "decision": "bolder"},
        "gof": {},
        "gspure_repair": {"iterations": 20},
    },
}

SCHEMES = {
    "pairs": {"traced": {"views": 4, "width": 32, "height": 24}},
    "schemes": {
        "splats_in_splats_hardened": {"iterations": 30, "max_gaussians": 400},
        "gs_hider_hardened": {"iterations": 30, "max_gaussians": 400},
        "secure_gs": {"iterations": 30, "max_anchors": 200},
        "keyss": {"iterations": 30, "max_gaussians": 400},
        "marked_clones": {"iterations": 30, "max_gaussians": 400, "decoder_steps": 20, "marking_steps": 20},
        "planted": {"gaussians": 400},
    },
    "views": {"off_path": 0},
    "extractions": ["message"],
    "method": {"min_samples": 3, "min_cluster_size": 5},
    "variants": {"unattacked": {}, "gspure": {}},
}
"""The schemes that `CONFIG` leaves out."""

PROJECTS = {"project": (CONFIG, "results/report.html"), "schemes": (SCHEMES, "results/tables/results.csv")}
"""Their configurations, and the file that each makes."""


@dataclass(frozen=True)
class Job:
    """One run of a rule: its shell command, the files that it takes and makes, and its log."""

    rule: str
    command: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    log: str


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    status: int
    printed: str
    seconds: float
    hangs: bool


def rules() -> set[str]:
    """All rules of the workflow that make something."""
    files = [ROOT / "Snakefile", *(ROOT / "rules").glob("*.smk")]
    return {
        name
        for file in files
        for name in re.findall(r"^(?:use rule \w+ as|rule) (\w+)", file.read_text(), re.MULTILINE)
    } - TARGETS


def build(folder: Path) -> None:
    """Write the user's files of one of `PROJECTS`; schemes whose packages are missing are left out."""
    config, target = PROJECTS[folder.name]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "target").write_text(target)
    available = {n: s for n, s in config["schemes"].items() if all(map(find_spec, find_scheme(n).packages))}
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (40, 3))
    for name in ("photos", "hidden"):
        colmap_project(folder / name, ring(), points)
    shutil.copy(ROOT / "examples" / "spread_spectrum.py", folder)
    (folder / "config.yaml").write_text(yaml.safe_dump({**config, "schemes": available}))


def environment(**more: str) -> dict[str, str]:
    """Return the environment of jobs; without memory for its threads, OpenBLAS does not end, so it has none."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])
    fixed = {"PATH": path, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    return {**os.environ, **fixed, **more}


def ended(
    command: list[str] | str,
    folder: Path,
    limits: Callable[[], None] | None = None,
    patience: float = 600.0,
    **more: str,
) -> Ended:
    """Run a command in a session of its own, and kill what is left of it after its end or `patience` seconds."""
    begun = time.monotonic()
    with tempfile.TemporaryFile() as printed:
        process = subprocess.Popen(
            ["bash", "-c", command] if isinstance(command, str) else command,
            cwd=folder,
            env=environment(**more),
            stdout=printed,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=limits,  # noqa: PLW1509
        )
        with suppress(subprocess.TimeoutExpired):
            process.wait(patience)
        hangs = process.poll() is None
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        status = process.wait()
        printed.seek(0)
        return Ended(status, printed.read().decode(errors="replace"), time.monotonic() - begun, hangs)


def snakemake(folder: Path, *arguments: str) -> Ended:
    """Make the target of a project."""
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile"), "--configfile", "config.yaml"]
    target = (folder / "target").read_text()
    return ended([*command, "--cores", "2", target, *arguments], folder, patience=3600.0)


def finished(folder: Path) -> Path:
    """Return the folder of one of `PROJECTS`, in which its workflow has run, once."""
    if not (folder / PROJECTS[folder.name][1]).is_file():
        shutil.rmtree(folder, ignore_errors=True)
        build(folder)
        done = snakemake(folder)
        if done.status:
            raise RuntimeError(done.printed[-3000:])
    return folder


def jobs(folder: Path) -> list[Job]:
    """Return the jobs that ran in a project, as Snakemake keeps them."""
    outputs: dict[str, list[str]] = {}
    records = {}
    for file in sorted((folder / ".snakemake" / "metadata").rglob("*")):
        if file.is_file():
            record = json.loads(file.read_text())
            output = _decoded(file.relative_to(folder / ".snakemake" / "metadata"))
            outputs.setdefault(record["shellcmd"], []).append(output)
            records[record["shellcmd"]] = record
    return sorted(
        (
            Job(
                r["rule"],
                command,
                tuple(_relative(p, folder) for p in r["input"]),
                (*outputs[command], *_stages(outputs[command], folder)),
                r["log"][0],
            )
            for command, r in records.items()
        ),
        key=lambda job: (job.rule, job.command),
    )


def _stages(outputs: list[str], folder: Path) -> list[str]:
    """Return the stages that a job stores beside its outputs: those that an index of contributions lists."""
    indices = [folder / output for output in outputs if Path(output).suffix == ".tsv"]
    return [_relative(str(stage.path), folder) for index in indices for stage in read_index(index)]


def one_per_rule(folder: Path, rules: Collection[str]) -> list[Job]:
    """Return the longest command of each of some rules."""
    longest = {job.rule: job for job in sorted(jobs(folder), key=lambda job: len(job.command))}
    return [job for rule, job in longest.items() if rule in rules]


def contents(folder: Path) -> dict[str, str]:
    """Digests of all products of a project; temporary files, which killed jobs leave, are hidden and left out."""
    files = (path for name in KEPT for path in sorted((folder / name).rglob("*")) if path.is_file())
    relative = {path: path.relative_to(folder) for path in files}
    return {
        str(name): digest(path.read_bytes())
        for path, name in relative.items()
        if not VARYING & set(name.parts) and not any(part.startswith(".") for part in name.parts)
    }


def _relative(path: str, folder: Path) -> str:
    return os.path.relpath(folder / path, folder)


def _decoded(name: Path) -> str:
    from base64 import urlsafe_b64decode

    text = "".join(part.removeprefix("@") for part in name.parts)
    return urlsafe_b64decode(text + "=" * (-len(text) % 4)).decode()
