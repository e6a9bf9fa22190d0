"""How a run is going: a bar on a terminal, a line now and then in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from gspure.progress import say
from gspure.training.trainer import Trainer

_SECONDS = {True: 1.0, False: 10.0}
"""Between two reports: on a terminal, and in a log."""

Show = Callable[[int, str], None]


def watched(trainer: Trainer, iterations: int, psnr: Callable[[], float]) -> Iterator[float]:
    """Train, and report the mean loss since the last report, PSNR, number of Gaussians and iterations per second.

    Parameters
    ----------
    trainer : Trainer
    iterations : int
        Length of the run.
    psnr : callable
        Measures the model as it is; called once per report.

    """
    terminal = sys.stderr.isatty()
    with (_bar if terminal else _lines)(iterations) as show:
        losses, last = [], time.monotonic()
        for loss in trainer:
            yield loss
            losses.append(loss)
            seconds = time.monotonic() - last
            if seconds > _SECONDS[terminal] or trainer.iteration == iterations:
                speed = f"{len(losses) / seconds:.1f} it/s"
                quality = f"loss {np.mean(losses):.4f}  PSNR {psnr():.2f}"
                show(trainer.iteration, f"{quality}  {trainer.model.count} Gaussians  {speed}")
                losses, last = [], time.monotonic()


@contextmanager
def _bar(iterations: int) -> Iterator[Show]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}"), TimeRemainingColumn())
    with Progress(TextColumn("train"), *columns, console=Console(stderr=True)) as progress:
        task = progress.add_task("", total=iterations)

        def show(iteration: int, text: str) -> None:
            progress.update(task, completed=iteration, description=text)

        yield show


@contextmanager
def _lines(iterations: int) -> Iterator[Show]:
    def show(iteration: int, text: str) -> None:
        say(f"train: {iteration} of {iterations}  {text}")

    yield show
