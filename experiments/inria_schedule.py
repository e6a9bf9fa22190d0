"""gspure's trainer with the schedule of 30,000 steps that INRIA's has, ended early, for a comparison at equal steps.

``python -m experiments.inria_schedule CAPTURE STEPS`` prints the PSNR of held-out views. CAPTURE is a COLMAP project,
on which the same number of steps of INRIA's trainer is, in its folder::

    gspure cuda-free -- python train.py -s CAPTURE -m OUT --eval --iterations STEPS --test_iterations STEPS
"""

import sys
from pathlib import Path

import numpy as np

from gspure.metrics.image_metrics import psnr
from gspure.opencl.adam import LearningRates
from gspure.renderer import Renderer
from gspure.training.dataset import read_dataset, read_photographs
from gspure.training.initialization import gaussians_at
from gspure.training.schedule import ITERATIONS, Schedule
from gspure.training.trainer import beginning, train

NO_BOUND = 1_000_000  # of growth


class EndedEarly(Schedule):
    """The first steps of the full schedule."""

    def rates(self, iteration: int, extent: float) -> LearningRates:
        """Return the learning rates of the full schedule."""
        return Schedule.scaled(ITERATIONS).rates(iteration, extent)


def main(source: Path, steps: int) -> None:
    """Train, and print the held-out PSNR."""
    full = Schedule.scaled(ITERATIONS)
    schedule = EndedEarly(
        iterations=steps,
        sh_every=full.sh_every,
        densify_from=full.densify_from,
        densify_until=min(steps, full.densify_until),  # INRIA's is evaluated before it grows
        densify_every=full.densify_every,
        reset_every=full.reset_every,
    )
    data = read_dataset(source, "native")
    images, truth = (read_photographs(views) for views in (data.train, data.test))
    begin = beginning(gaussians_at(data.xyz, data.rgb), seed=0)
    model = train(data.train, images, begin, schedule=schedule, extent=data.extent, max_gaussians=NO_BOUND, device=None)
    renderer = Renderer(model)
    levels = [psnr(renderer.image(view).clip(0, 1), photo) for view, photo in zip(data.test, truth, strict=True)]
    print(f"{np.mean(levels):.2f} dB in {len(levels)} held-out views, {len(model)} Gaussians")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
