"""Call GS-Hider's train_wm.py in the current folder: scene, message, iterations, out (gs_hider_authors.toml)."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

WATER = Path("/userhome/StegaGS/data/water")  # where its dataset reader expects WATER/SCENE/00000.png and so on

scene, message, iterations, out = sys.argv[1:]
if len({Path(folder, "sparse/0/images.txt").read_text() for folder in (scene, message)}) > 1:
    sys.exit("gs_hider_authors.py: scene and message need the same poses (gspure pair --protocol shared)")
name = f"gspure-{os.getpid()}"
run = Path(out, "run")
run.mkdir()
source = run / name
source.symlink_to(scene)
shutil.copytree(Path(message, "images"), WATER / name)
try:
    steps = ["--iterations", iterations, "--save_iterations", iterations, "--checkpoint_iterations", iterations]
    steps += ["--test_iterations", "0"]  # none: its tests download a network for LPIPS
    subprocess.run([sys.executable, "train_wm.py", "-s", source, "-m", run, *steps], check=True)
finally:
    shutil.rmtree(WATER / name)
shutil.copy(run / f"point_cloud/iteration_{iterations}/point_cloud.ply", Path(out, "public"))
shutil.copy(run / f"chkpnt{iterations}_net.pth", Path(out, "public"))
shutil.copy(run / f"chkpnt{iterations}_waternet.pth", Path(out, "key"))
