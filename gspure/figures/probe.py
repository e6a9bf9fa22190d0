"""Does OpenGL work here? Asked in a process of its own, since VTK without a working OpenGL ends its process.

``python -m gspure.figures.probe`` renders a small picture off screen and prints the name of the renderer.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from typing import Final

WINDOW_VARIABLE: Final = "VTK_DEFAULT_OPENGL_WINDOW"
INSTALL_HINT: Final = "`make gl` in a checkout of gspure, or `sudo apt-get install libegl1 libgl1-mesa-dri`"

_SECONDS: Final = 60


@dataclass(frozen=True)
class OpenGL:
    """What became of one small off-screen picture: the name of the renderer that drew it, or else the problem."""

    renderer: str | None
    problem: str | None


def prefer_egl() -> None:
    """Let VTK render through EGL, unless the user chose otherwise: it looks for an X server first, even off screen."""
    if sys.platform == "linux":
        os.environ.setdefault(WINDOW_VARIABLE, "vtkEGLRenderWindow")


@cache
def try_opengl() -> OpenGL:
    """Draw one small picture off screen, in a process of its own."""
    command = [sys.executable, "-m", "gspure.figures.probe"]
    try:
        child = subprocess.run(command, capture_output=True, text=True, check=False, timeout=_SECONDS)
    except subprocess.TimeoutExpired:
        return OpenGL(None, f"no answer within {_SECONDS} s")
    if child.returncode == 0:
        return OpenGL(child.stdout.strip(), None)
    last_words = child.stderr.strip().splitlines()[-1:] if child.returncode > 0 else []
    return OpenGL(None, (last_words or [f"off-screen rendering ends the process (status {child.returncode})"])[0])


def gl_problem() -> str | None:
    """Return why 3-D pictures cannot be drawn with OpenGL, and what helps; None if they can."""
    problem = try_opengl().problem
    return problem and f"{problem}: {INSTALL_HINT}"


def _draw() -> str:
    """Draw a sphere in 32 x 32 pixels and return OpenGL's name of the renderer."""
    prefer_egl()
    import numpy as np
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, window_size=(32, 32))
    plotter.add_mesh(pv.Sphere(), color="red")
    image = plotter.screenshot(return_img=True)
    capabilities = plotter.render_window.ReportCapabilities()
    plotter.close()
    if np.ptp(image) == 0:
        raise SystemExit("the picture is blank")
    names = [line.partition(":")[2].strip() for line in capabilities.splitlines() if "renderer string" in line]
    return names[0] if names else "unnamed"


if __name__ == "__main__":
    print(_draw())  # noqa: T201
