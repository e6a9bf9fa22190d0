"""What the attack `distil` costs: PSNR of the scene against CPU time, for public models of one pair (docs/limits.md).

gspure pair interior-1 interior-2 --views 100 --width 400 --height 300 --out pair
gspure embed splats_in_splats pair --set iterations=7000 --set max_gaussians=100000 --out splats_in_splats
python -m experiments.price pair splats_in_splats/public ... > experiments/tables/price.csv
python -m experiments.price --draw experiments/tables/price.csv docs/pictures/price.png

In the committed table, KeySS and Marked Clones were trained for 2500 iterations, GS-Hider for 3000.
"""

import csv
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gspure.attacks import find_attack
from gspure.figures import style
from gspure.images import read_back
from gspure.metrics.image_metrics import psnr
from gspure.metrics.names import display_name
from gspure.public_model import PublicModel
from gspure.schemes.pair import read_pair
from gspure.schemes.registry import read_public_model
from gspure.training.dataset import read_photographs

ITERATIONS = (500, 1000, 2000, 4000)
SECONDS = (10, 20, 50, 100)
COLUMNS = ("scheme", "iterations", "CPU-s", "scene PSNR", "rows")
Row = tuple[str, int, str, str, int]


def measured(pair: Path, folder: Path) -> Iterator[Row]:
    """Yield a row for the public model in a folder SCHEME/public, and for each length of the training."""
    scene = read_pair(pair).scene
    photographs = read_photographs(scene.dataset.test)
    name = folder.parent.name
    public = read_public_model(folder, name)

    def row(iterations: int, begin: float, model: PublicModel) -> Row:
        seconds = time.process_time() - begin
        render = model.scene()
        images = [read_back(render(view)) for view in scene.dataset.test]
        level = np.mean([psnr(image, photograph) for image, photograph in zip(images, photographs, strict=True)])
        return name, iterations, f"{seconds:.1f}", f"{level:.2f}", len(model.model)

    yield row(0, time.process_time(), public)
    for iterations in ITERATIONS:
        begin = time.process_time()
        attacked = find_attack("distil").apply(public, cameras=scene.views, iterations=iterations)
        yield row(iterations, begin, PublicModel(attacked.model))


def draw(table: Path, path: Path) -> None:
    """Draw the curve of each scheme, and the level of its public model."""
    with style.page(path, style.COLUMN, 2.4) as figure:
        axes = figure.add_subplot()
        rows = [*csv.DictReader(table.read_text().splitlines())]
        for scheme, colour in zip(dict.fromkeys(row["scheme"] for row in rows), style.CLUSTERS, strict=False):
            before, *after = [row for row in rows if row["scheme"] == scheme]
            level = float(before["scene PSNR"])
            seconds = [float(row["CPU-s"]) for row in after]
            drops = [level - float(row["scene PSNR"]) for row in after]
            axes.plot(seconds, drops, "o-", color=colour, markersize=3, linewidth=1, label=display_name(scheme))
        axes.axhline(0, color=style.FAINT, linewidth=0.5)
        axes.set_xscale("log")
        axes.set_xticks(SECONDS, map(str, SECONDS))
        axes.minorticks_off()
        axes.set_xlabel("CPU time of distil (s)")
        axes.set_ylabel("drop of the scene's PSNR (dB)")
        figure.legend(loc="outside upper center", ncols=3)


if __name__ == "__main__":
    if sys.argv[1] == "--draw":
        draw(*map(Path, sys.argv[2:]))
    else:
        pair, *folders = map(Path, sys.argv[1:])
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(COLUMNS)
        for folder in folders:
            for row in measured(pair, folder):
                writer.writerow(row)
                sys.stdout.flush()
