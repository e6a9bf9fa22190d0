"""Time of each kernel, by the device's own clock: a view with contributions, and an iteration of training.

``python -m benchmarks.kernels [STYLE]``, in a checkout; the kernel style is by default that of the chosen device.
"""

import sys
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pyopencl as cl

from benchmarks.bench_training import AT_REST, trainable
from benchmarks.room import LARGE, SMALL, camera, room
from gspure.opencl import engine
from gspure.renderer import Renderer

ROUNDS = 10


def profiled() -> list[tuple[str, cl.Event]]:
    """Make every engine profile its kernels; return the list to which launches add their events."""
    queue = cl.CommandQueue
    launch = engine.Program.launch
    events: list[tuple[str, cl.Event]] = []

    def launch_and_keep(program: engine.Program, name: str, items: int, *args: Any, **settings: Any) -> Any | None:
        event = launch(program, name, items, *args, **settings)
        if event:
            events.append((name, event))
        return event

    cl.CommandQueue = lambda context: queue(context, properties=cl.command_queue_properties.PROFILING_ENABLE)
    engine.Program.launch = launch_and_keep  # type: ignore[assignment, method-assign]
    return events


def show(title: str, run: Callable[[], object], events: list[tuple[str, cl.Event]]) -> None:
    """Print a table of the kernels of `run`, means of several rounds."""
    run()
    run()
    events.clear()
    begin = time.perf_counter()
    for _ in range(ROUNDS):
        run()
    wall = 1e3 * (time.perf_counter() - begin) / ROUNDS
    sums: Counter[str] = Counter()
    for name, event in events:
        event.wait()
        sums[name] += 1e-6 * (event.profile.end - event.profile.start) / ROUNDS
    print(f"\n{title}: {wall:.2f} ms on the clock, {sum(sums.values()):.2f} ms in kernels")
    for name, milliseconds in sums.most_common():
        print(f"  {name:24s} {milliseconds:8.3f} ms", flush=True)


def main(style: Any) -> None:
    """Print all tables."""
    events = profiled()
    for scene in (SMALL, LARGE):
        renderer = Renderer(scene.model, style=style)
        show(f"contributions, {scene.name}", partial(renderer.contributions, scene.camera), events)
    model = trainable(room(200_000), style)
    view = camera(640, 480)
    model.set_targets([np.random.default_rng(0).random((480, 640, 3), np.float32)])
    show("iteration, 200k @640x480", partial(model.step, view, 0, AT_REST), events)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else None)
