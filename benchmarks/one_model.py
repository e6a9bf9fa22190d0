"""The work on one model in a process of its own: read it, take the contributions of a view, render the view.

``python one_model.py MODEL WIDTH HEIGHT`` prints the largest resident size in MB after each step.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from room import camera

from gspure.model import Gaussians, read_model
from gspure.renderer import Renderer


def contributions(model: Gaussians, width: int, height: int) -> None:
    Renderer(model, energy="ray").contributions(camera(width, height))


def image(model: Gaussians, width: int, height: int) -> None:
    Renderer(model).image(camera(width, height))


def say_peak(step: str) -> None:
    # Linux counts the parent's size into getrusage's ru_maxrss, but not into this.
    (kib,) = re.findall(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text(encoding="ascii"))
    print(step, int(kib) * 1024 / 1e6)


if __name__ == "__main__":
    path, width, height = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    say_peak("start")
    model = read_model(path)
    contributions(model, width, height)
    say_peak("contributions")
    image(model, width, height)
    say_peak("image")
