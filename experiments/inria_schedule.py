"""gspure's trainer with its own schedule, and with the first steps of INRIA's 30,000: rows of tables/programs.csv.

``python -m experiments.inria_schedule CAPTURE`` trains as many steps on a COLMAP project as `experiments.programs` lets
INRIA's trainer take on it.
"""

import sys
from pathlib import Path
from time import process_time

import numpy as np

from experiments.programs import ITERATIONS as STEPS
from experiments.programs import Outcome, record
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


def first_of_inrias(steps: int) -> Schedule:
    """Return the first steps of INRIA's schedule."""
    full = Schedule.scaled(ITERATIONS)
    return EndedEarly(
        iterations=steps,
        sh_every=full.sh_every,
        densify_from=full.densify_from,
        densify_until=min(steps, full.densify_until),  # INRIA's is evaluated before it grows
        densify_every=full.densify_every,
        reset_every=full.reset_every,
    )


def main(source: Path) -> None:
    """Train by both schedules."""
    data = read_dataset(source, "native")
    images, truth = (read_photographs(views) for views in (data.train, data.test))
    schedules = {"own": Schedule.scaled(STEPS), "INRIA's": first_of_inrias(STEPS)}
    for name, schedule in schedules.items():
        started = process_time()
        begin = beginning(gaussians_at(data.xyz, data.rgb), seed=0)
        model = train(
            data.train, images, begin, schedule=schedule, extent=data.extent, max_gaussians=NO_BOUND, device=None
        )
        seconds = process_time() - started
        renderer = Renderer(model)
        levels = [psnr(renderer.image(view).clip(0, 1), photo) for view, photo in zip(data.test, truth, strict=True)]
        record(
            Outcome(source.name, f"gspure, {name} schedule", "", "", f"{np.mean(levels):.1f}", f"{seconds:.0f}", "ran")
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
