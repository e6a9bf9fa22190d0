"""Progress reports of a run: a bar on a terminal, lines in a log."""

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

import numpy as np

from gspure.progress import say, shows_bars

_SECONDS = {True: 1.0, False: 10.0}  # between two reports, on a terminal (True) and in a log (False)

Show = Callable[[int, str], None]


def watched(losses: Iterable[float], iterations: int, state: Callable[[], str], done: int = 0) -> Iterator[float]:
    """Yield `losses`, one per iteration, and report their mean since the last report, `state` and speed.

    `state` describes the current model, such as ``"PSNR 30.12 12000 Gaussians"``, and is called once per report; `done`
    iterations were done before.
    """
    terminal = shows_bars()
    with (_bar if terminal else _lines)(iterations) as show:
        recent: list[float] = []
        last = time.monotonic()
        for iteration, loss in enumerate(losses, done + 1):
            yield loss
            recent.append(loss)
            seconds = time.monotonic() - last
            if seconds > _SECONDS[terminal] or iteration == iterations:
                show(iteration, f"loss {np.mean(recent):.4f}  {state()}  {len(recent) / seconds:.1f} it/s")
                recent, last = [], time.monotonic()


@contextmanager
def _bar(iterations: int) -> Iterator[Show]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.description}", markup=False), TimeRemainingColumn())
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
