"""The work on one model in a process of its own: read it, take the contributions of a view, render the view.

``python one_model.py MODEL WIDTH HEIGHT`` prints, after each step, the largest resident size so far, and how much is
resident without the mapped files; both in MB.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from room import camera

from gspure.model import Gaussians, read_model
from gspure.renderer import Renderer


def contributions(model: Gaussians, width: int, height: int) -> None:
    renderer = Renderer(model, energy="ray")
    renderer.contributions(camera(width, height))
    say_sizes("contributions")


def image(model: Gaussians, width: int, height: int) -> None:
    renderer = Renderer(model)
    renderer.image(camera(width, height))
    say_sizes("image")


def say_sizes(step: str) -> None:
    # Linux counts the parent's size into getrusage's ru_maxrss, but not into this.
    status = Path("/proc/self/status").read_text(encoding="ascii")
    kib = [int(re.findall(rf"{name}:\s*(\d+) kB", status)[0]) for name in ("VmHWM", "RssAnon")]
    print(step, *(1024 * size / 1e6 for size in kib))


if __name__ == "__main__":
    path, width, height = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    say_sizes("start")
    model = read_model(path)
    contributions(model, width, height)
    image(model, width, height)
