"""Run public programs that were written for CUDA, from the user's checkouts of them: tables/programs.csv.

``python -m experiments.programs CHECKOUTS SCENE OUT`` runs those of `PROGRAMS` whose folder is in CHECKOUTS, as they
are, on the scene of a pair (``gspure pair room vault --width 208 --height 156 --out room``) or on a COLMAP project.
What they write goes to OUT; rows of other programs and scenes stay in the table.
"""

import csv
import re
import resource
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from gspure.cameras import read_cameras
from gspure.cameras.colmap import write_colmap
from gspure.cameras.points import stored_points
from gspure.errors import InputError
from gspure.files import write_text
from gspure.images import read_image
from gspure.metrics.csv_tables import csv_text
from gspure_torch.cuda_free.dialects import DIALECTS, find_wrapper, read_dialect

TABLE = Path(__file__).resolve().parent / "tables" / "programs.csv"
ITERATIONS = 700
FEATURES = 16
WATER = Path("/userhome/StegaGS/data/water")  # from which GS-Hider reads


@dataclass(frozen=True)
class Program:
    """A public program: its repository on GitHub, its command, and its dialect if the folder has no wrapper."""

    repository: str
    command: str
    dialect: str | None = None

    @property
    def folder(self) -> str:
        """The name of its folder."""
        return self.repository.partition("/")[2]


class Outcome(NamedTuple):
    """How a program ended, or a trainer of ours: a row of the table."""

    scene: str
    program: str
    commit: str
    dialect: str
    psnr: str  # of held-out views, dB
    cpu_seconds: str
    end: str


def record(outcome: Outcome) -> None:
    """Print an outcome, and put it into the table, in place of an older one."""
    print(*outcome, flush=True)
    rows = {outcome[:2]: outcome}
    if TABLE.is_file():
        with TABLE.open(newline="", encoding="utf-8") as file:
            known = [Outcome(**row) for row in csv.DictReader(file)]
        rows = {row[:2]: row for row in known} | rows
    write_text(TABLE, csv_text(Outcome._fields, [rows[key] for key in sorted(rows)]))


EVALUATED = f"--eval --iterations {ITERATIONS} --test_iterations {ITERATIONS} --save_iterations {ITERATIONS}"
PROGRAMS = (
    Program("zxk1212/ConcealGS", f"train.py -s {{data}} -m {{out}} {EVALUATED}"),
    Program("liruilong940607/gaussian-splatting", f"train.py -s {{data}} -m {{out}} {EVALUATED}", "gsplat-1.4"),
    Program("ShijieZhou-UCLA/feature-3dgs", f"train.py -s {{data}} -m {{out}} -f lseg {EVALUATED}"),
    Program("xuanyuzhang21/GS-Hider", f"train_wm.py -s {{data}} -m {{out}} {EVALUATED}"),
    Program("RY-Paper/KeySS", "train2hide_prompt_random_fast16.py -s {data} -m {out} --prompt key"),
    Program("ingra14m/Deformable-3D-Gaussians", f"train.py -s {{data}} -m {{out}} {EVALUATED}", "depth"),
    Program("autonomousvision/mip-splatting", f"train.py -s {{data}} -m {{out}} {EVALUATED}"),
    Program("city-super/Scaffold-GS", f"train.py -s {{data}} -m {{out}} {EVALUATED}"),
    Program("hbb1/2d-gaussian-splatting", f"train.py -s {{data}} -m {{out}} {EVALUATED}"),
)


def capture_of(pair: Path, folder: Path) -> None:
    """Write the scene of a pair as a COLMAP project, and with it what two of the programs need."""
    views = sorted(read_cameras(pair / "cameras.json"), key=lambda view: view.name)
    images = [read_image(pair / "scene" / f"{view.name}.png") for view in views]
    write_colmap(folder, views, images, stored_points(pair))
    features = folder / "rgb_feature_langseg"  # of Feature 3DGS: here, mixed colours of the photographs
    features.mkdir()
    mixing = np.random.default_rng(0).normal(size=(FEATURES, 3)).astype(np.float32)
    for number, image in enumerate(images):
        height, width, _ = image.shape
        small = image.reshape(height // 2, 2, width // 2, 2, 3).mean(axis=(1, 3))
        mixed = np.einsum("fc,hwc->fhw", mixing, small)
        torch.save(torch.from_numpy(mixed), features / f"{number:05d}_fmap_CxHxW.pt")
    if WATER.is_dir():  # of GS-Hider: the message's photographs
        (WATER / folder.name).mkdir(exist_ok=True)
        for number, view in enumerate(views):
            shutil.copy(pair / "message" / f"{view.name}.png", WATER / folder.name / f"{number:05d}.png")


def dialect_of(program: Program, folder: Path) -> str:
    """Return the dialect that `gspure cuda-free` uses, or what it refuses."""
    if program.dialect:
        return program.dialect
    wrapper = find_wrapper(folder)
    if wrapper is None:
        return "no wrapper"
    try:
        dialect = read_dialect(wrapper)
    except InputError as error:
        return f"refused: {error.found}"
    names = [name for name, known in DIALECTS.items() if known.outputs == dialect.outputs]
    return names[0] if names else ", ".join(dialect.outputs)


def outcome(program: Program, folder: Path, data: Path, out: Path) -> Outcome:
    """Run a program, and return how it ended."""
    words = shlex.split(program.command.format(data=data, out=out / program.folder))
    option = ["--dialect", program.dialect] if program.dialect else []
    command = [sys.executable, "-m", "gspure", "cuda-free", *option, "--", "python", *words]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    (out / f"{program.folder}.log").write_text(done.stdout + done.stderr)
    git = ["git", "-C", str(folder), "rev-parse", "--short=8", "HEAD"]
    commit = subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip()
    names = (data.name, program.repository, commit, dialect_of(program, folder))
    if done.returncode == 0:
        levels = re.findall(r"Evaluating test: .*?PSNR ([\d.]+)", done.stdout)
        return Outcome(*names, f"{float(levels[-1]):.1f}", f"{seconds:.0f}", "ran")
    errors = re.findall(r"^\w*Error: .*", done.stderr, re.MULTILINE)
    return Outcome(*names, "", "", errors[-1] if errors else "refused")


def main(checkouts: Path, scene: Path, out: Path) -> None:
    """Write the table."""
    capture = scene
    if not (scene / "sparse").is_dir():
        capture = out / scene.name
        if not capture.exists():
            capture_of(scene, capture)
    for program in PROGRAMS:
        if (checkouts / program.folder).is_dir():
            record(outcome(program, checkouts / program.folder, capture, out))


if __name__ == "__main__":
    main(*(Path(argument).resolve() for argument in sys.argv[1:]))
