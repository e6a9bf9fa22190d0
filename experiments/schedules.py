"""Training schedules in turns: CPU time, and PSNR and SSIM of held-out views (tables/schedules-*.csv).

``python -m experiments.schedules DATA RESOLUTION STEPS HALF EQUAL SEED...`` prints, for each seed, a row for STEPS
vanilla steps, and for HALF and EQUAL fast ones, which should take half of the time, and all of it; EQUAL 0 leaves these
out. The committed tables are of the plush figure of captures.yaml (240px 2000 1750 3300 0 1 2; without the longer run,
240px 2000 1750 0 3 4 5) and of Instant NGP's fox (320px 2000 1250 2500 0 1 2).
"""

import sys
import time
from pathlib import Path

import numpy as np

from gspure.metrics.image_metrics import psnr, ssim
from gspure.renderer import Renderer
from gspure.training.dataset import Dataset, read_dataset, read_photographs, with_agreed_points
from gspure.training.fast import schedule_of
from gspure.training.initialization import gaussians_at, thinned
from gspure.training.trainer import beginning, train


def trained(data: Dataset, images: list[np.ndarray], name: str, iterations: int, seed: int) -> tuple[Renderer, int]:
    """Return the renderer of a model trained as `gspure train` does, and its number of Gaussians."""
    schedule = schedule_of(name, iterations).of_photographs()
    if schedule.needs_surfaces:
        data = with_agreed_points(data, images, seed)
    most = data.max_gaussians(schedule.pixels_per_gaussian)
    begin = beginning(gaussians_at(*thinned(data.xyz, data.rgb, schedule.budget(most, 1), seed)), seed)
    model = train(data.train, images, begin, schedule=schedule, extent=data.extent, max_gaussians=most, device=None)
    return Renderer(model), len(model)


def compare(source: Path, resolution: str, steps: dict[str, tuple[str, int]], seeds: list[int]) -> None:
    """Print a row of each run."""
    print("run,seed,steps,Gaussians,CPU s,relative to the first,PSNR,SSIM")
    photographs = None
    for seed in seeds:
        data = read_dataset(source, resolution, seed=seed)
        if photographs is None:
            photographs = [read_photographs(views) for views in (data.train, data.test)]
            trained(data, photographs[0], "fast", 50, seed)  # builds the kernels
        images, truth = photographs
        first = 0.0
        for run, (schedule, iterations) in steps.items():
            begin = time.process_time()
            renderer, count = trained(data, images, schedule, iterations, seed)
            seconds = time.process_time() - begin
            if not first:
                first = seconds
            renders = [renderer.image(view).clip(0, 1) for view in data.test]
            level = np.mean([psnr(*pair) for pair in zip(renders, truth, strict=True)])
            likeness = np.mean([ssim(*pair) for pair in zip(renders, truth, strict=True)])
            times = f"{seconds:.1f},{seconds / first:.2f}"
            print(f"{run},{seed},{iterations},{count},{times},{level:.2f},{likeness:.4f}", flush=True)


if __name__ == "__main__":
    folder, rule, *numbers = sys.argv[1:]
    whole, half, equal, *seeds = map(int, numbers)
    runs = {"vanilla": ("vanilla", whole), "fast": ("fast", half), "fast in the same time": ("fast", equal)}
    compare(Path(folder), rule, {name: run for name, run in runs.items() if run[1]}, seeds)
