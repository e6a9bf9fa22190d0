"""Run public programs that were written for CUDA, from the user's checkouts of them, and print the table of the page.

``python benchmarks/programs.py CHECKOUTS DATA OUT`` runs those of `PROGRAMS` whose folder is in CHECKOUTS, as they are,
on the COLMAP capture DATA. What they write goes to OUT.
"""

import re
import resource
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from gspure.cuda_free.dialects import DIALECTS, find_wrapper, read_dialect
from gspure.errors import InputError

ITERATIONS = 700
FEATURES = 16


@dataclass(frozen=True)
class Program:
    """A public program: the name of its folder, its dialect if the folder has no wrapper, and its command."""

    folder: str
    command: str
    dialect: str | None = None


EVALUATED = f"--eval --iterations {ITERATIONS} --test_iterations {ITERATIONS} --save_iterations {ITERATIONS}"
PROGRAMS = (
    Program("ConcealGS", f"train.py -s {{data}} -m {{out}} {EVALUATED}"),
    Program("gaussian-splatting", f"train.py -s {{data}} -m {{out}} {EVALUATED}", "gsplat-1.4"),
    Program("feature-3dgs", f"train.py -s {{data}} -m {{out}} -f lseg {EVALUATED}"),
    Program("GS-Hider", f"train_wm.py -s {{data}} -m {{out}} {EVALUATED}"),
    Program("Deformable-3D-Gaussians", f"train.py -s {{data}} -m {{out}} {EVALUATED}", "depth"),
    Program("mip-splatting", f"train.py -s {{data}} -m {{out}} {EVALUATED}"),
    Program("Scaffold-GS", f"train.py -s {{data}} -m {{out}} {EVALUATED}"),
    Program("2d-gaussian-splatting", f"train.py -s {{data}} -m {{out}} {EVALUATED}"),
)


def with_features(data: Path, out: Path) -> Path:
    """Return a folder with the capture and, for Feature 3DGS, features of each photograph: its colours, mixed."""
    folder = out / data.name
    features = folder / "rgb_feature_langseg"
    features.mkdir(parents=True, exist_ok=True)
    for part in ("images", "sparse"):
        if not (folder / part).exists():
            (folder / part).symlink_to(data / part)
    mixing = np.random.default_rng(0).normal(size=(FEATURES, 3)).astype(np.float32)
    for file in (data / "images").iterdir():
        pixels = np.asarray(Image.open(file).convert("RGB").reduce(2), np.float32) / 255
        torch.save(torch.from_numpy(np.einsum("fc,hwc->fhw", mixing, pixels)), features / f"{file.stem}_fmap_CxHxW.pt")
    return folder


def dialect_of(program: Program, folder: Path) -> str:
    """Return the dialect that `gspure cuda-free` uses, or what it refuses."""
    if program.dialect:
        return program.dialect
    wrapper = find_wrapper(folder)
    if wrapper is None:
        return "none here"
    try:
        dialect = read_dialect(wrapper)
    except InputError as error:
        return f"refused: {error.field} {error.found}"
    names = [name for name, known in DIALECTS.items() if known.outputs == dialect.outputs]
    return names[0] if names else ", ".join(dialect.outputs)


def row(program: Program, folder: Path, data: Path, out: Path) -> str:
    """Run a program, and return its row of the table."""
    words = shlex.split(program.command.format(data=data, out=out / program.folder))
    option = ["--dialect", program.dialect] if program.dialect else []
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "gspure", "cuda-free", *option, "--", "python", *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    (out / f"{program.folder}.log").write_text(done.stdout + done.stderr)
    git = ["git", "-C", str(folder), "rev-parse", "--short=8", "HEAD"]
    commit = subprocess.run(git, capture_output=True, text=True, check=False)
    levels = re.findall(r"Evaluating test: .*?PSNR ([\d.]+)", done.stdout)
    level = f"{float(levels[-1]):.1f}" if levels else "-"
    end = "runs" if done.returncode == 0 else done.stderr.strip().rpartition("\n")[2]
    name = f"{program.folder} {commit.stdout.strip()}"
    return f"| {name} | {dialect_of(program, folder)} | {end} | {level} | {seconds:.0f} |"


if __name__ == "__main__":
    checkouts, data, out = map(Path, sys.argv[1:])
    capture = with_features(data, out.resolve())
    print(f"| program | dialect | end | held-out PSNR after {ITERATIONS} steps, dB | CPU seconds |")
    print("| --- | --- | --- | ---: | ---: |")
    for program in PROGRAMS:
        if (checkouts / program.folder).is_dir():
            print(row(program, checkouts / program.folder, capture, out.resolve()), flush=True)
