"""Test of OpenGL in a separate process, since VTK ends its process if OpenGL does not work.

``python -m gspure.figures.probe`` renders a small picture off screen and prints the name of the renderer.
"""

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
    """The result of the test: the name of OpenGL's renderer, or the problem."""

    renderer: str | None
    problem: str | None


def prefer_egl() -> None:
    """Let VTK render with EGL unless the user chose otherwise; by default it needs an X server, even off screen."""
    if sys.platform == "linux":
        os.environ.setdefault(WINDOW_VARIABLE, "vtkEGLRenderWindow")


@cache
def try_opengl() -> OpenGL:
    """Draw a small picture off screen in a separate process."""
    command = [sys.executable, "-m", "gspure.figures.probe"]
    try:
        child = subprocess.run(command, capture_output=True, text=True, check=False, timeout=_SECONDS)
    except subprocess.TimeoutExpired:
        return OpenGL(None, f"no answer within {_SECONDS} s")
    if child.returncode == 0:
        return OpenGL(child.stdout.strip(), None)
    last_line = child.stderr.strip().splitlines()[-1:] if child.returncode > 0 else []
    return OpenGL(None, (last_line or [f"off-screen rendering ends the process (status {child.returncode})"])[0])


def gl_problem() -> str | None:
    """Return why OpenGL does not work, with a remedy; None if it works."""
    problem = try_opengl().problem
    return problem and f"{problem}: {INSTALL_HINT}"


def _draw() -> str:
    """Draw a sphere in 32 x 32 pixels and return OpenGL's name of the renderer; VTK loads faster than pyvista."""
    prefer_egl()
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - registers what draws
    from vtkmodules.vtkCommonCore import vtkUnsignedCharArray
    from vtkmodules.vtkFiltersSources import vtkSphereSource
    from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer, vtkRenderWindow

    mapper, actor, renderer, window = vtkPolyDataMapper(), vtkActor(), vtkRenderer(), vtkRenderWindow()
    source = vtkSphereSource()  # a port of one without a name would end the process
    mapper.SetInputConnection(source.GetOutputPort())
    actor.SetMapper(mapper)
    renderer.AddActor(actor)
    window.AddRenderer(renderer)
    window.OffScreenRenderingOn()
    window.SetSize(32, 32)
    window.Render()
    pixels = vtkUnsignedCharArray()
    window.GetPixelData(0, 0, 31, 31, 0, pixels, 0)
    if pixels.GetRange(0)[0] == pixels.GetRange(0)[1]:
        raise SystemExit("the picture is blank")
    capabilities = window.ReportCapabilities().splitlines()
    names = [line.partition(":")[2].strip() for line in capabilities if "renderer string" in line]
    return names[0] if names else "unnamed"


if __name__ == "__main__":
    print(_draw())  # noqa: T201
