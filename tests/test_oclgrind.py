"""The kernels in oclgrind, a simulator that reports data races and invalid memory accesses."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.oclgrind

LIBRARY = "liboclgrind-rt-icd.so"

PREPARE = """
import numpy as np
from gspure.method.clusters import select
from gspure.method.tree import spanning_tree
from gspure.opencl.device import matching_devices
from gspure.opencl.trainable import TrainableModel, TrainState
from gspure.renderer import Renderer
from tests.comparison import assert_gradients_agree, assert_pixels_agree, steady_pixels
from tests.models import blobs, tilted_camera
from tests.reference.blending import render
from tests.reference.gradients import pull_back
from tests.test_clustering import with_ties
from tests.test_opacity_field import assert_agrees
from tests.test_trainable import RATES, parameters, scene
device, view, style = matching_devices("oclgrind")[0], tilted_camera(20, 18), {style!r}
"""

RENDER = """
for energy in ("ewa", "ray"):
    model, view = blobs(150, 1, sh_degree=1), tilted_camera(40, 30)
    renderer = Renderer(model, device, energy=energy, style=style)
    expected = render(model, view, energy)
    assert_pixels_agree(renderer.image(view), expected.channels, expected.margins, spread=expected.channels.max())
    renderer.depth(view)
    renderer.contributions(view)
"""

POINTS = """
model = blobs(40, 1, sh_degree=0)
renderer = Renderer(model, device, energy="ray", style=style)
assert_agrees(renderer.opacities_at(view, model.means), model, view, model.means)
"""

GRADIENTS = """
model = blobs(17, 1, sh_degree=1)
_, pullback = Renderer(model, device, style=style).vjp(view)
gradient = np.random.default_rng(0).normal(size=(18, 20, 3)).astype(np.float32)
gradient *= steady_pixels(render(model, view, "ewa").margins)[..., None]
assert_gradients_agree(pullback(gradient), pull_back(model, view, gradient), model)
"""

TRAIN = """
model = TrainableModel(TrainState.fresh(parameters(scene(17))), device=device, style=style)
model.set_targets([np.random.default_rng(0).random((18, 20, 3), np.float32)])
model.step(view, 0, RATES)
model.statistics()
model.replace(model.state())
"""

CLUSTER = """
tree = spanning_tree(with_ties(1, 300), 5, device=device)
assert select(tree, 10, "leaf", device=device).max() > 0
"""

WRITE = """
import numpy as np
import pyopencl as cl
context = cl.create_some_context()
queue = cl.CommandQueue(context)
target = cl.Buffer(context, cl.mem_flags.READ_WRITE, 8)
source = "kernel void write(global int *x) {{ x[{place}] = get_global_id(0); }}"
kernel = cl.Kernel(cl.Program(context, source).build(), "write")
kernel(queue, (8,), (1,), target)
queue.finish()
"""


@pytest.fixture
def simulate(tmp_path):
    """Run a Python program on the simulator; return what it has to report."""
    command = shutil.which("oclgrind")
    folder = Path(command or "").resolve().parents[1] / "lib" if command else Path()
    found = [*folder.glob(f"oclgrind/{LIBRARY}"), *folder.glob(f"*/oclgrind/{LIBRARY}"), *folder.glob(LIBRARY)]
    if not found:
        pytest.skip("oclgrind is not installed (Debian package: oclgrind)")
    vendors = tmp_path / "vendors"
    vendors.mkdir()
    (vendors / "oclgrind.icd").write_text(f"{found[0]}\n")

    def run(program):
        log = tmp_path / "log.txt"
        environment = {
            "OCL_ICD_VENDORS": str(vendors),
            "OCLGRIND_BUILD_OPTIONS": "-cl-opt-disable",  # optimized, a true comparison of vectors counts 255, not 1
            "OCLGRIND_CHECK_API": "1",
            "OCLGRIND_DATA_RACES": "1",
            "OCLGRIND_LOG": str(log),
            "PYOPENCL_NO_CACHE": "1",
        }
        done = subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, **environment},
            cwd=Path(__file__).parents[1],
            check=False,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        # Asking for a property that OpenCL 1.2 does not know is no mistake.
        calls = {function for function in re.findall(r"Function: (\w+)", done.stderr) if not function.endswith("Info")}
        return log.read_text() + " ".join(sorted(calls))

    return run


def test_the_simulator_reports_races_and_invalid_accesses(simulate):
    assert "data race" in simulate(WRITE.format(place="0"))
    assert "Invalid write" in simulate(WRITE.format(place="get_global_id(0) + 2"))


@pytest.mark.parametrize(
    "program",
    [RENDER, POINTS, GRADIENTS, TRAIN, CLUSTER],
    ids=["images", "points", "gradients", "training", "clustering"],
)
def test_the_kernels_have_no_race_and_no_invalid_access(simulate, style, program):
    assert simulate(PREPARE.format(style=style) + program) == ""
