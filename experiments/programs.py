"""Run public programs that were written for CUDA, from the user's checkouts of them, and print the list of the page.

``python -m experiments.programs CHECKOUTS PAIR OUT`` runs those of `PROGRAMS` whose folder is in CHECKOUTS, as they
are, on the scene of a pair (``gspure pair room vault --width 208 --height 156 --out PAIR``). What they write goes to
OUT.
"""

import re
import resource
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from gspure.cameras import read_cameras
from gspure.cameras.colmap import write_colmap
from gspure.cameras.points import stored_points
from gspure.errors import InputError
from gspure.images import read_image
from gspure_torch.cuda_free.dialects import DIALECTS, find_wrapper, read_dialect

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


def outcome(program: Program, folder: Path, data: Path, out: Path) -> str:
    """Run a program, and return its line of the page."""
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
    levels = re.findall(r"Evaluating test: .*?PSNR ([\d.]+)", done.stdout)
    dialect = dialect_of(program, folder)
    errors = re.findall(r"^\w*Error: .*", done.stderr, re.MULTILINE)
    end = f"stops: `{errors[-1]}`" if errors else "stops"
    if done.returncode == 0:
        end = f"{float(levels[-1]):.1f} dB, {seconds:.0f} CPU s"
    elif dialect.startswith("refused"):
        end = ""
    return f"- {program.repository} {commit}, {dialect}: {end}"


def main(checkouts: Path, pair: Path, out: Path) -> None:
    """Print the lines of the page."""
    capture = out / pair.name
    if not capture.exists():
        capture_of(pair, capture)
    for program in PROGRAMS:
        if (checkouts / program.folder).is_dir():
            print(outcome(program, checkouts / program.folder, capture, out), flush=True)


if __name__ == "__main__":
    main(*(Path(argument).resolve() for argument in sys.argv[1:]))
